//! The directives that change the current transform, in f64.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::directives::Statement;
use super::state::Reader;
use super::{Fault, Result};

impl Reader {
    /// Changes the active ones of the two transforms.
    fn change_ctm(
        &mut self,
        statement: &Statement,
        change: impl Fn(usize, DAffine3) -> DAffine3,
    ) -> Result<()> {
        for key in 0..2 {
            if self.state.active[key] {
                self.state.ctm[key] = change(key, self.state.ctm[key]);
                if !self.state.ctm[key].is_finite() {
                    let message = "a transform that overflows; finite coordinates would be accepted";
                    return Err(Fault::new(statement.place, message));
                }
            }
        }
        Ok(())
    }

    fn concat(&mut self, statement: &Statement, transform: DAffine3) -> Result<()> {
        self.change_ctm(statement, |_, ctm| ctm * transform)
    }

    pub fn identity(&mut self, statement: &Statement) -> Result<()> {
        self.change_ctm(statement, |_, _| DAffine3::IDENTITY)
    }

    pub fn translate(&mut self, statement: &Statement) -> Result<()> {
        self.concat(statement, DAffine3::from_translation(DVec3::from_slice(&statement.numbers)))
    }

    pub fn scale(&mut self, statement: &Statement) -> Result<()> {
        self.concat(statement, DAffine3::from_scale(DVec3::from_slice(&statement.numbers)))
    }

    /// Degrees, axis.
    pub fn rotate(&mut self, statement: &Statement) -> Result<()> {
        let axis = DVec3::from_slice(&statement.numbers[1..]);
        let Some(axis) = unit(axis) else {
            return Err(Fault::new(
                statement.place,
                "Rotate about the axis 0 0 0; another axis would be accepted",
            ));
        };
        let angle = statement.numbers[0].to_radians();
        self.concat(statement, DAffine3::from_axis_angle(axis, angle))
    }

    /// Eye, point looked at, up: world to camera.
    pub fn look_at(&mut self, statement: &Statement) -> Result<()> {
        let [eye, at, up] = [0, 3, 6].map(|i| DVec3::from_slice(&statement.numbers[i..]));
        let forward = unit(at - eye).unwrap_or_default();
        let right = unit(up).unwrap_or_default().cross(forward).normalize_or_zero();
        if right == DVec3::ZERO {
            let message = "LookAt without a direction; an up vector across the view would be accepted";
            return Err(Fault::new(statement.place, message));
        }
        let matrix3 = DMat3::from_cols(right, forward.cross(right), forward);
        self.concat(statement, DAffine3 { matrix3, translation: eye }.inverse())
    }

    pub fn transform(&mut self, statement: &Statement) -> Result<()> {
        let transform = affine(statement)?;
        self.change_ctm(statement, |_, _| transform)
    }

    pub fn concat_transform(&mut self, statement: &Statement) -> Result<()> {
        let transform = affine(statement)?;
        self.concat(statement, transform)
    }

    pub fn coordinate_system(&mut self, statement: &Statement) -> Result<()> {
        self.coordinate_systems.insert(statement.strings[0].clone(), self.state.ctm);
        Ok(())
    }

    pub fn coord_sys_transform(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        // All of it, whatever transform is active.
        match self.coordinate_systems.get(name) {
            Some(keys) => self.state.ctm = *keys,
            None => {
                let message = format!("coordinate system \"{name}\", which nothing names, is left out");
                self.warnings.add(statement.place, message);
            }
        }
        Ok(())
    }

    pub fn active_transform(&mut self, statement: &Statement) -> Result<()> {
        self.state.active = match statement.strings[0].as_str() {
            "StartTime" => [true, false],
            "EndTime" => [false, true],
            "All" => [true, true],
            other => {
                let message = format!("ActiveTransform {other}; StartTime, EndTime and All are accepted");
                return Err(Fault::new(statement.place, message));
            }
        };
        Ok(())
    }

    pub fn set_transform_times(&mut self, statement: &Statement) -> Result<()> {
        let [start, end] = [statement.numbers[0], statement.numbers[1]];
        if start > end {
            let message = format!("TransformTimes {start} {end}; rising times would be accepted");
            return Err(Fault::new(statement.place, message));
        }
        self.transform_times = [start as f32, end as f32];
        Ok(())
    }
}

/// The inverse of a transform, if it has one and its determinant is a number that f64 can hold.
pub fn inverse(transform: &DAffine3) -> Option<DAffine3> {
    let inverse = transform.inverse();
    (transform.matrix3.determinant().is_normal() && inverse.is_finite()).then_some(inverse)
}

/// A vector of length 1, however short or long it was.
pub fn unit(vector: DVec3) -> Option<DVec3> {
    // Its square may be too small, or too large, for f64.
    (vector / vector.abs().max_element()).try_normalize()
}

/// The 16 numbers, column by column, as an affine transform.
fn affine(statement: &Statement) -> Result<DAffine3> {
    let columns: [f64; 16] = statement.numbers[..].try_into().expect("the table says 16 numbers");
    let [.., w] = columns;
    if [columns[3], columns[7], columns[11]] != [0.0; 3] || w == 0.0 {
        let message = "a projective matrix; one whose last row is 0 0 0 1 would be accepted";
        return Err(Fault::new(statement.place, message));
    }
    Ok(DAffine3::from_mat4(DMat4::from_cols_array(&columns) * w.recip()))
}

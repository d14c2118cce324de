//! Directives that change the current transform, computed in f64.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use crate::scene::pbrt::builder::SceneBuilder;
use crate::scene::pbrt::parser::{ParseError, Result, Statement};

impl SceneBuilder {
    /// Applies `change`, given a key index and its transform, to the active transforms.
    fn change_ctm(
        &mut self,
        statement: &Statement,
        change: impl Fn(usize, DAffine3) -> DAffine3,
    ) -> Result<()> {
        for key in 0..2 {
            if self.state.active[key] {
                self.state.ctm[key] = change(key, self.state.ctm[key]);
                if !self.state.ctm[key].is_finite() {
                    let message = "the current transform overflows; expected finite coordinates";
                    return Err(ParseError::new(statement.loc, message));
                }
            }
        }
        Ok(())
    }

    /// Multiplies the active transforms by `transform` from the right.
    fn concat(&mut self, statement: &Statement, transform: DAffine3) -> Result<()> {
        self.change_ctm(statement, |_, ctm| ctm * transform)
    }

    /// `Identity`.
    pub fn identity(&mut self, statement: &Statement) -> Result<()> {
        self.change_ctm(statement, |_, _| DAffine3::IDENTITY)
    }

    /// `Translate`.
    pub fn translate(&mut self, statement: &Statement) -> Result<()> {
        self.concat(statement, DAffine3::from_translation(DVec3::from_slice(&statement.numbers)))
    }

    /// `Scale`.
    pub fn scale(&mut self, statement: &Statement) -> Result<()> {
        self.concat(statement, DAffine3::from_scale(DVec3::from_slice(&statement.numbers)))
    }

    /// `Rotate`: angle in degrees, axis.
    pub fn rotate(&mut self, statement: &Statement) -> Result<()> {
        let axis = DVec3::from_slice(&statement.numbers[1..]);
        let Some(axis) = normalized(axis) else {
            return Err(ParseError::new(
                statement.loc,
                "Rotate about the axis 0 0 0; expected an axis of nonzero length",
            ));
        };
        let angle = statement.numbers[0].to_radians();
        self.concat(statement, DAffine3::from_axis_angle(axis, angle))
    }

    /// `LookAt`: eye, point looked at, up. The transform maps world to camera space.
    pub fn look_at(&mut self, statement: &Statement) -> Result<()> {
        let [eye, at, up] = [0, 3, 6].map(|i| DVec3::from_slice(&statement.numbers[i..]));
        let forward = normalized(at - eye).unwrap_or_default();
        let right = normalized(up).unwrap_or_default().cross(forward).normalize_or_zero();
        if right == DVec3::ZERO {
            let message = "LookAt without an orientation; expected an up vector that is not parallel to the view direction";
            return Err(ParseError::new(statement.loc, message));
        }
        let matrix3 = DMat3::from_cols(right, forward.cross(right), forward);
        self.concat(statement, DAffine3 { matrix3, translation: eye }.inverse())
    }

    /// `Transform`: replaces the current transform.
    pub fn transform(&mut self, statement: &Statement) -> Result<()> {
        let transform = self.affine(statement)?;
        self.change_ctm(statement, |_, _| transform)
    }

    /// `ConcatTransform`.
    pub fn concat_transform(&mut self, statement: &Statement) -> Result<()> {
        let transform = self.affine(statement)?;
        self.concat(statement, transform)
    }

    /// Converts 16 numbers in column-major order to an affine transform. The projective part of a matrix is dropped
    /// with a warning.
    fn affine(&mut self, statement: &Statement) -> Result<DAffine3> {
        let mut columns: [f64; 16] = statement.numbers[..].try_into().expect("the table says 16 numbers");
        let w = columns[15];
        if w == 0.0 {
            let message = "the last element of the matrix is 0; expected a last row of 0 0 0 1";
            return Err(ParseError::new(statement.loc, message));
        }
        if [columns[3], columns[7], columns[11]] != [0.0; 3] {
            self.warnings.add(statement.loc, "the matrix is projective; its last row is taken for 0 0 0 1");
            (columns[3], columns[7], columns[11]) = (0.0, 0.0, 0.0);
        }
        Ok(DAffine3::from_mat4(DMat4::from_cols_array(&columns) * w.recip()))
    }

    /// `CoordinateSystem`: names the current transform.
    pub fn coordinate_system(&mut self, statement: &Statement) -> Result<()> {
        self.coordinate_systems.insert(statement.strings[0].clone(), self.state.ctm);
        Ok(())
    }

    /// `CoordSysTransform`: restores a named transform.
    pub fn coord_sys_transform(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        // Both transforms are set, whichever are active
        match self.coordinate_systems.get(name) {
            Some(keys) => self.state.ctm = *keys,
            None => {
                let message = format!("unknown coordinate system \"{name}\" is ignored");
                self.warnings.add(statement.loc, message);
            }
        }
        Ok(())
    }

    /// `ActiveTransform`.
    pub fn active_transform(&mut self, statement: &Statement) -> Result<()> {
        self.state.active = match statement.strings[0].as_str() {
            "StartTime" => [true, false],
            "EndTime" => [false, true],
            "All" => [true, true],
            other => {
                let message = format!("unknown ActiveTransform {other}; expected StartTime, EndTime or All");
                return Err(ParseError::new(statement.loc, message));
            }
        };
        Ok(())
    }

    /// `TransformTimes`.
    pub fn set_transform_times(&mut self, statement: &Statement) -> Result<()> {
        let [start, end] = [statement.numbers[0], statement.numbers[1]];
        if start > end {
            let message = format!("TransformTimes {start} {end} are not sorted; expected rising times");
            return Err(ParseError::new(statement.loc, message));
        }
        self.transform_times = [start as f32, end as f32];
        Ok(())
    }
}

/// The inverse of a transform, if its determinant is a normal `f64` and the inverse is finite.
pub fn inverse(transform: &DAffine3) -> Option<DAffine3> {
    let inverse = transform.inverse();
    (transform.matrix3.determinant().is_normal() && inverse.is_finite()).then_some(inverse)
}

/// Normalises a vector of any nonzero length.
pub fn normalized(vector: DVec3) -> Option<DVec3> {
    // The squared length may underflow or overflow
    (vector / vector.abs().max_element()).try_normalize()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{DAffine3, DVec3};

    use crate::scene::Shape;
    use crate::scene::pbrt::read_str;

    #[test]
    fn the_projective_part_of_a_matrix_is_dropped() {
        let read = |matrix: &str| {
            read_str(&format!("WorldBegin\n ConcatTransform [{matrix}] Shape \"sphere\""), Path::new(""))
        };
        let scene = read("2 0 0 .1 0 2 0 0 0 0 2 0 2 4 6 2").unwrap();
        assert_eq!(
            scene.warnings,
            ["<text>:2:2: the matrix is projective; its last row is taken for 0 0 0 1"]
        );
        let Shape::Sphere(sphere) = &scene.primitives[0].shape else { panic!() };
        assert_eq!(sphere.to_object, DAffine3::from_translation(DVec3::new(1.0, 2.0, 3.0)));
        let error = read("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 0").unwrap_err();
        assert!(error.message.contains("last element"), "{error}");
    }
}

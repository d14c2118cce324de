//! Where primitives go: into the static part of the scene, into an object that is instanced, or,
//! when they move, into an object of their own.

use glam::{DAffine3, DVec3};

use super::directives::Statement;
use super::state::{Block, Keys, Reader};
use super::transforms::inverse;
use super::{Fault, Place, Result};
use crate::scene::{AnimatedTransform, Instance, Primitive};

/// Primitives that share a space.
#[derive(Default)]
pub struct Group {
    pub name: String,
    pub primitives: Vec<Primitive>,
    /// Where the group's origin lies in the space it is described in, so that a group far from
    /// that space's origin loses no precision as `f32`. Set by the first shape.
    pub pivot: Option<DVec3>,
}

impl Group {
    pub fn new(name: String) -> Self {
        Self { name, ..Self::default() }
    }
}

/// A group as a part of an object that is instanced.
#[derive(Clone)]
pub struct Part {
    pub group: usize,
    /// The group's motion inside the object; the identity if it stands still.
    keys: Keys,
}

/// An object's instance.
pub struct Placed {
    name: String,
    keys: Keys,
    place: Place,
}

/// Where a shape goes.
pub struct Placement {
    pub group: usize,
    /// Shape space to the group's space.
    pub to_group: DAffine3,
}

/// Most parts of an object that move by themselves. Every instance of it is as many instances.
const MAX_PARTS: usize = 1024;

const STILL: Keys = [DAffine3::IDENTITY; 2];

impl Reader {
    /// Where a shape at the current transform goes. `reference` is a point of it, in its space.
    pub fn place_shape(&mut self, reference: DVec3, place: Place) -> Result<Placement> {
        let ctm = self.state.ctm;
        check_invertible(&ctm, place)?;
        if self.is_animated() {
            return self.place_moving_shape(reference, place);
        }
        let Some((name, parts)) = &mut self.current_object else {
            return Ok(Placement { group: 0, to_group: self.to_render() });
        };
        let group = match parts.iter().find(|part| part.keys == STILL) {
            Some(part) => part.group,
            None => {
                self.groups.push(Group::new(name.clone()));
                let group = self.groups.len() - 1;
                parts.push(Part { group, keys: STILL });
                group
            }
        };
        let pivot = *self.groups[group].pivot.get_or_insert_with(|| ctm[0].transform_point3(reference));
        Ok(Placement { group, to_group: DAffine3::from_translation(-pivot) * ctm[0] })
    }

    /// A moving shape stays in its own space; its transform becomes that of an instance.
    fn place_moving_shape(&mut self, reference: DVec3, place: Place) -> Result<Placement> {
        if let Some((name, parts)) = &self.current_object
            && parts.len() >= MAX_PARTS
        {
            let message =
                format!("object \"{name}\" of more than {MAX_PARTS} moving shapes; fewer would be accepted");
            return Err(Fault::new(place, message));
        }
        let keys = self.state.ctm;
        let name = self.current_object.as_ref().map_or(String::new(), |(name, _)| name.clone());
        self.groups.push(Group { name, primitives: Vec::new(), pivot: Some(reference) });
        let group = self.groups.len() - 1;
        match &mut self.current_object {
            Some((_, parts)) => parts.push(Part { group, keys }),
            None => self.add_instance(group, keys),
        }
        Ok(Placement { group, to_group: DAffine3::from_translation(-reference) })
    }

    /// Places a group in the world; `keys` take it there.
    fn add_instance(&mut self, group: usize, keys: Keys) {
        let shift = DAffine3::from_translation(-self.origin());
        let [start, end] = keys.map(|key| shift * key);
        let [t0, t1] = self.transform_times;
        let pivot = self.groups[group].pivot.unwrap_or_default();
        let transform = AnimatedTransform::new(start, end, t0, t1).after_translation(pivot);
        self.instances.push(Instance { object: group, transform });
    }

    pub fn object_begin(&mut self, statement: &Statement) -> Result<()> {
        let name = statement.strings[0].clone();
        if let Some((open, _)) = &self.current_object {
            let message = format!("ObjectBegin inside object \"{open}\"; ObjectEnd would be accepted");
            return Err(Fault::new(statement.place, message));
        }
        self.push(Block::Object, statement.place)?;
        self.current_object = Some((name, Vec::new()));
        Ok(())
    }

    pub fn object_end(&mut self, statement: &Statement) -> Result<()> {
        let Some((name, parts)) = self.current_object.take() else {
            let message = "ObjectEnd without ObjectBegin; another directive would be accepted";
            return Err(Fault::new(statement.place, message));
        };
        self.pop(Block::Object, statement.place)?;
        self.objects.insert(name, parts);
        Ok(())
    }

    pub fn object_instance(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        if let Some((open, _)) = &self.current_object {
            let message = format!("ObjectInstance inside object \"{open}\"; ObjectEnd would be accepted");
            return Err(Fault::new(statement.place, message));
        }
        check_invertible(&self.state.ctm, statement.place)?;
        let placed = Placed { name: name.clone(), keys: self.state.ctm, place: statement.place };
        if !self.objects.contains_key(name) && self.dialect.names_may_come_first() {
            self.awaited_instances.push(placed);
            return Ok(());
        }
        self.place_object(&placed)
    }

    fn place_object(&mut self, Placed { name, keys, place }: &Placed) -> Result<()> {
        let Some(parts) = self.objects.get(name).cloned() else {
            let message = format!("object \"{name}\"; one defined before would be accepted");
            return Err(Fault::new(*place, message));
        };
        for part in parts {
            self.add_instance(part.group, [keys[0] * part.keys[0], keys[1] * part.keys[1]]);
        }
        Ok(())
    }

    /// Places the instances of objects that were made after these were named.
    ///
    /// # Errors
    /// Of an object that was never made.
    pub fn place_awaited_instances(&mut self) -> Result<()> {
        std::mem::take(&mut self.awaited_instances).iter().try_for_each(|placed| self.place_object(placed))
    }
}

/// Normals and rays need the inverse of a transform.
fn check_invertible(keys: &Keys, place: Place) -> Result<()> {
    // As `f32`, which they will become.
    let fits = |key: &DAffine3| {
        key.as_affine3a().is_finite() && inverse(key).is_some_and(|inverse| inverse.as_affine3a().is_finite())
    };
    if keys.iter().all(fits) {
        return Ok(());
    }
    Err(Fault::new(place, "a singular transform; one that can be inverted would be accepted"))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::pbrt::read_str;

    #[test]
    fn an_object_of_very_many_moving_parts_is_refused() {
        let object = |parts: usize| {
            let moving = "Shape \"sphere\" ".repeat(parts);
            format!("WorldBegin ActiveTransform EndTime Translate 1 0 0 ObjectBegin \"o\" {moving} ObjectEnd")
        };
        let instance = "ObjectInstance \"o\"";
        let scene = read_str(&format!("{} {instance} {instance}", object(1024)), Path::new("")).unwrap();
        assert_eq!(scene.instances.len(), 2048);
        let error = read_str(&object(1025), Path::new("")).unwrap_err();
        assert!(error.message.contains("more than 1024 moving shapes"), "{error}");
    }
}

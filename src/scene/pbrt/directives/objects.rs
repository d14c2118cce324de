//! `ObjectBegin`, `ObjectEnd` and `ObjectInstance`, and the group that each shape goes into.
//!
//! A shape goes into the static group, into the current object, or, if it moves, into a group of
//! its own.

use glam::{DAffine3, DVec3};

use super::transforms::inverse;
use crate::scene::pbrt::builder::{
    InstanceEntity, ObjectDefinition, ObjectPart, PrimitiveGroup, SceneBuilder, ScopeKind, TransformSet,
};
use crate::scene::pbrt::parser::{FileLoc, ParseError, Result, Statement};
use crate::scene::{AnimatedTransform, Instance};

/// The group that a shape goes into.
pub struct ShapePlacement {
    /// Index into [`SceneBuilder::groups`].
    pub group: usize,
    /// Shape space to the group's space.
    pub to_group: DAffine3,
}

/// Most moving parts of an object. Each instance of the object becomes this many instances.
const MAX_PARTS: usize = 1024;

const STILL: TransformSet = [DAffine3::IDENTITY; 2];

impl SceneBuilder {
    /// The group for a shape at the current transform. `reference` is a point on the shape, in its
    /// space.
    pub fn place_shape(&mut self, reference: DVec3, loc: FileLoc) -> Result<ShapePlacement> {
        let ctm = self.state.ctm;
        check_invertible(&ctm, loc)?;
        if self.state.is_animated() {
            return self.place_moving_shape(reference, loc);
        }
        let Some(ObjectDefinition { name, parts }) = &mut self.current_object else {
            return Ok(ShapePlacement { group: 0, to_group: self.to_render() });
        };
        let group = match parts.iter().find(|part| part.transforms == STILL) {
            Some(part) => part.group,
            None => {
                self.groups.push(PrimitiveGroup::new(name.clone()));
                let group = self.groups.len() - 1;
                parts.push(ObjectPart { group, transforms: STILL });
                group
            }
        };
        let pivot = *self.groups[group].pivot.get_or_insert_with(|| ctm[0].transform_point3(reference));
        Ok(ShapePlacement { group, to_group: DAffine3::from_translation(-pivot) * ctm[0] })
    }

    /// Puts a moving shape into a group of its own. The group stays in shape space, and the current
    /// transform becomes that of its instance.
    fn place_moving_shape(&mut self, reference: DVec3, loc: FileLoc) -> Result<ShapePlacement> {
        if let Some(ObjectDefinition { name, parts }) = &self.current_object
            && parts.len() >= MAX_PARTS
        {
            let message =
                format!("object \"{name}\" has more than {MAX_PARTS} moving shapes; expected fewer");
            return Err(ParseError::new(loc, message));
        }
        let transforms = self.state.ctm;
        let name = self.current_object.as_ref().map_or(String::new(), |object| object.name.clone());
        self.groups.push(PrimitiveGroup { name, primitives: Vec::new(), pivot: Some(reference) });
        let group = self.groups.len() - 1;
        match &mut self.current_object {
            Some(object) => object.parts.push(ObjectPart { group, transforms }),
            None => self.add_instance(group, transforms),
        }
        Ok(ShapePlacement { group, to_group: DAffine3::from_translation(-reference) })
    }

    /// Adds an instance of a group; `transforms` map its space to world space.
    fn add_instance(&mut self, group: usize, transforms: TransformSet) {
        let shift = DAffine3::from_translation(-self.origin());
        let [start, end] = transforms.map(|transform| shift * transform);
        let [t0, t1] = self.transform_times;
        let pivot = self.groups[group].pivot.unwrap_or_default();
        let transform = AnimatedTransform::new(start, end, t0, t1).after_translation(pivot);
        self.instances.push(Instance { object: group, transform });
    }

    /// `ObjectBegin`.
    pub fn object_begin(&mut self, statement: &Statement) -> Result<()> {
        let name = statement.strings[0].clone();
        if let Some(ObjectDefinition { name: open, .. }) = &self.current_object {
            let message = format!("ObjectBegin inside object \"{open}\"; expected ObjectEnd");
            return Err(ParseError::new(statement.loc, message));
        }
        self.push_scope(ScopeKind::Object, statement.loc)?;
        self.current_object = Some(ObjectDefinition { name, parts: Vec::new() });
        Ok(())
    }

    /// `ObjectEnd`.
    pub fn object_end(&mut self, statement: &Statement) -> Result<()> {
        let Some(ObjectDefinition { name, parts }) = self.current_object.take() else {
            let message = "ObjectEnd without ObjectBegin; expected another directive";
            return Err(ParseError::new(statement.loc, message));
        };
        self.pop_scope(ScopeKind::Object, statement.loc)?;
        self.objects.insert(name, parts);
        Ok(())
    }

    /// `ObjectInstance`. In v4 the object may be defined later.
    pub fn object_instance(&mut self, statement: &Statement) -> Result<()> {
        let name = &statement.strings[0];
        if let Some(ObjectDefinition { name: open, .. }) = &self.current_object {
            let message = format!("ObjectInstance inside object \"{open}\"; expected ObjectEnd");
            return Err(ParseError::new(statement.loc, message));
        }
        check_invertible(&self.state.ctm, statement.loc)?;
        let instance = InstanceEntity { name: name.clone(), transforms: self.state.ctm, loc: statement.loc };
        if !self.objects.contains_key(name) && self.dialect.allows_forward_references() {
            self.forward_instances.push(instance);
            return Ok(());
        }
        self.place_object(&instance)
    }

    /// Adds instances of all parts of an object.
    fn place_object(&mut self, InstanceEntity { name, transforms, loc }: &InstanceEntity) -> Result<()> {
        let Some(parts) = self.objects.get(name).cloned() else {
            let message = format!("unknown object \"{name}\"; expected an object that ObjectBegin defines");
            return self.warn_or_fail(ParseError::new(*loc, message), "the instance is ignored");
        };
        for part in parts {
            self.add_instance(
                part.group,
                [transforms[0] * part.transforms[0], transforms[1] * part.transforms[1]],
            );
        }
        Ok(())
    }

    /// Places the instances of objects that were defined after the instances.
    ///
    /// # Errors
    /// If an object was never defined.
    pub fn place_forward_instances(&mut self) -> Result<()> {
        std::mem::take(&mut self.forward_instances)
            .iter()
            .try_for_each(|instance| self.place_object(instance))
    }
}

/// Checks that transforms have finite inverses, which normals and rays need.
fn check_invertible(transforms: &TransformSet, loc: FileLoc) -> Result<()> {
    // Check in `f32`, the precision of the scene
    let fits = |transform: &DAffine3| {
        transform.as_affine3a().is_finite()
            && inverse(transform).is_some_and(|inverse| inverse.as_affine3a().is_finite())
    };
    if transforms.iter().all(fits) {
        return Ok(());
    }
    Err(ParseError::new(loc, "the current transform is singular; expected an invertible transform"))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scene::pbrt::read_str;

    #[test]
    fn an_object_with_too_many_moving_parts_is_an_error() {
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

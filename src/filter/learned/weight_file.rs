//! The network's weights, in a file in the format of Safetensors.
//!
//! Each layer NAME has a tensor NAME.weight of `[row][column][input][output]` and one NAME.bias of `[output]`, both of
//! half-precision numbers.

use half::f16;
use safetensors::{Dtype, SafeTensors};

use super::convolution::Convolution;

/// What is wrong with a file of weights.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WeightFileError {
    #[error("not a file of weights: {0}")]
    Format(String),
    #[error("tensor {name}: found {found}, expected {expected}")]
    Tensor { name: String, found: String, expected: String },
}

/// A file of weights.
pub struct WeightFile<'a>(SafeTensors<'a>);

impl<'a> WeightFile<'a> {
    pub fn new(bytes: &'a [u8]) -> Result<Self, WeightFileError> {
        SafeTensors::deserialize(bytes).map(Self).map_err(|error| WeightFileError::Format(error.to_string()))
    }

    /// Returns a layer with a kernel of `side`×`side` pixels.
    pub fn layer(
        &self,
        name: &str,
        side: usize,
        inputs: usize,
        outputs: usize,
    ) -> Result<Convolution, WeightFileError> {
        let weights = self.tensor(&format!("{name}.weight"), &[side, side, inputs, outputs])?;
        let bias = self.tensor(&format!("{name}.bias"), &[outputs])?;
        Ok(Convolution::new(side, inputs, &weights, &bias))
    }

    fn tensor(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, WeightFileError> {
        let expected = format!("finite F16 {shape:?}");
        let error = |found| WeightFileError::Tensor { name: name.into(), found, expected: expected.clone() };
        let tensor = self.0.tensor(name).map_err(|_| error("none".into()))?;
        if (tensor.dtype(), tensor.shape()) != (Dtype::F16, shape) {
            return Err(error(format!("{:?} {:?}", tensor.dtype(), tensor.shape())));
        }
        let (pairs, _) = tensor.data().as_chunks();
        let values: Vec<f32> = pairs.iter().map(|&pair| f16::from_le_bytes(pair).to_f32()).collect();
        match values.iter().find(|v| !v.is_finite()) {
            Some(value) => Err(error(value.to_string())),
            None => Ok(values),
        }
    }
}

//! The network's weights, in a file in the format of Safetensors.
//!
//! Each layer NAME has a tensor NAME.weight of `[row][column][input][output]` and one NAME.bias of `[output]`, both of
//! half-precision numbers. The file's metadata has the key `format`, which is increased when the network changes.

use half::f16;
use safetensors::{Dtype, SafeTensorError, SafeTensors};

use super::block_convolution::BlockConvolution;
use super::convolution::Convolution;

/// The format of this version.
const FORMAT: &str = "prpf learned 2";

/// What is wrong with a file of weights.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WeightFileError {
    #[error("{0}")]
    Read(String),
    #[error("not a file of weights: {0}; accepted is what training/export.py writes")]
    NoWeights(String),
    #[error("format: found `{found}`; accepted is `{FORMAT}`")]
    Format { found: String },
    #[error("tensor {name}: found {found}; accepted are {accepted}")]
    Tensor { name: String, found: String, accepted: String },
    #[error(
        "found other weights than those in use; accepted is one file in a process, before the first filter pass"
    )]
    InUse,
}

/// A file of weights.
pub struct WeightFile<'a>(SafeTensors<'a>);

impl<'a> WeightFile<'a> {
    /// # Errors
    /// Bytes that are no such file, or one of another format.
    pub fn new(bytes: &'a [u8]) -> Result<Self, WeightFileError> {
        let no_weights = |error: SafeTensorError| WeightFileError::NoWeights(error.to_string());
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(no_weights)?;
        let found = metadata.metadata().as_ref().and_then(|texts| texts.get("format"));
        if found.is_none_or(|found| found != FORMAT) {
            let found = found.map_or("none", String::as_str);
            return Err(WeightFileError::Format { found: found.chars().take(40).collect() });
        }
        SafeTensors::deserialize(bytes).map(Self).map_err(no_weights)
    }

    /// Returns a layer with a kernel of 3×3 pixels.
    pub fn layer(&self, name: &str, inputs: usize, outputs: usize) -> Result<Convolution, WeightFileError> {
        let Tensors { side, weights, bias, .. } = self.tensors(name, 3, inputs, outputs)?;
        Ok(Convolution::new(side, inputs, &weights, &bias))
    }

    /// Returns the same for images whose parts begin with whole blocks of rows.
    pub fn block_layer(
        &self,
        name: &str,
        inputs: usize,
        outputs: usize,
    ) -> Result<BlockConvolution, WeightFileError> {
        let Tensors { weights, bias, .. } = self.tensors(name, 3, inputs, outputs)?;
        Ok(BlockConvolution::new(inputs, &weights, &bias))
    }

    /// Returns the weights and the bias of a layer.
    pub fn tensors(
        &self,
        name: &str,
        side: usize,
        inputs: usize,
        outputs: usize,
    ) -> Result<Tensors, WeightFileError> {
        let weights = self.tensor(&format!("{name}.weight"), &[side, side, inputs, outputs])?;
        let bias = self.tensor(&format!("{name}.bias"), &[outputs])?;
        Ok(Tensors { side, inputs, weights, bias })
    }

    fn tensor(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, WeightFileError> {
        let accepted = format!("finite F16 {shape:?}");
        let error = |found| WeightFileError::Tensor { name: name.into(), found, accepted: accepted.clone() };
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

/// The weights of a layer, `[row][column][input][output]`, and its bias.
pub struct Tensors {
    side: usize,
    inputs: usize,
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Tensors {
    /// Returns the layer that computes these of the outputs.
    pub fn select(&self, outputs: &[usize]) -> Convolution {
        let select = |values: &[f32]| -> Vec<f32> {
            let of_row = |row: &[f32]| outputs.iter().map(|&output| row[output]).collect::<Vec<_>>();
            values.chunks_exact(self.bias.len()).flat_map(of_row).collect()
        };
        Convolution::new(self.side, self.inputs, &select(&self.weights), &select(&self.bias))
    }
}

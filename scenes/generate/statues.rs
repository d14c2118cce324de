use crate::Asset; pub fn assets() -> Vec<Asset> { Vec::new() }

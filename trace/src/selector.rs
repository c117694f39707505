//! Choice of a compute device.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Choice of a device: `auto`, `cpu`, `gpu`, `gpu:INDEX` or `gpu:NAME`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum DeviceSelector {
    /// The first GPU in hardware, else the CPU.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The first GPU in hardware, else a software adapter.
    Gpu,
    /// The GPU at this place of `gpu::adapters`.
    Index(usize),
    /// The first GPU whose name contains this, in any case.
    Name(String),
}

impl FromStr for DeviceSelector {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => return Ok(Self::Auto),
            "cpu" => return Ok(Self::Cpu),
            "gpu" => return Ok(Self::Gpu),
            _ => {}
        }
        match text.strip_prefix("gpu:") {
            None | Some("") => Err("not one of auto, cpu, gpu, gpu:INDEX and gpu:NAME".to_owned()),
            Some(which) => Ok(which
                .parse()
                .map_or_else(|_| Self::Name(which.to_owned()), Self::Index)),
        }
    }
}

impl fmt::Display for DeviceSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu => f.write_str("gpu"),
            Self::Index(index) => write!(f, "gpu:{index}"),
            Self::Name(name) => write!(f, "gpu:{name}"),
        }
    }
}

impl Serialize for DeviceSelector {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn selectors_print_as_they_are_parsed() {
        for text in [
            "auto",
            "cpu",
            "gpu",
            "gpu:1",
            "gpu:llvmpipe",
            "gpu:RTX 4090",
        ] {
            assert_eq!(text.parse::<DeviceSelector>().unwrap().to_string(), text);
        }
        assert_eq!("gpu:0".parse(), Ok(DeviceSelector::Index(0)));
        assert_eq!("gpu:4a".parse(), Ok(DeviceSelector::Name("4a".to_owned())));
        for wrong in ["", "cuda", "gpu:", "GPU", "cpu:0"] {
            assert!(wrong.parse::<DeviceSelector>().is_err(), "{wrong}");
        }
    }
}

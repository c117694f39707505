//! Numbers in JSON.

/// Infinite levels as `null`, as JSON has no infinity.
pub(crate) mod or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        values: &[f32; 3],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        values
            .map(|value| value.is_finite().then_some(value))
            .serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<[f32; 3], D::Error> {
        let values = <[Option<f32>; 3]>::deserialize(deserializer)?;
        Ok(values.map(|value| value.unwrap_or(f32::INFINITY)))
    }
}

//! Steps of a script as pages ask for them: the grammar of edit scripts (`eagpt_edit`) without what
//! needs another file. What selectors, surfaces and actions may be is for the reader of scripts.

use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// A step of a script.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// For people.
    pub title: Option<String>,
    /// A selector.
    pub select: Option<Value>,
    /// A surface.
    pub insert: Option<Value>,
    /// Treatment of Gaussians that cross the boundary of the selection.
    pub trim: Option<String>,
    /// Factors of lights, by name.
    pub set_light: Option<BTreeMap<String, [f32; 3]>>,
    /// Actions in order.
    #[serde(default)]
    pub then: Vec<Value>,
}

impl Step {
    /// A step that sets one light.
    pub fn set_light(name: &str, factor: [f32; 3]) -> Self {
        Self {
            set_light: Some(BTreeMap::from([(name.to_owned(), factor)])),
            ..Self::default()
        }
    }

    /// The step as TOML, after an empty line.
    pub(super) fn toml(&self) -> String {
        let mut text = "\n[[step]]\n".to_owned();
        let mut line = |key: &str, value: String| text += &format!("{key} = {value}\n");
        let word = |text: &String| inline(&Value::from(text.as_str()));
        if let Some(title) = &self.title {
            line("title", word(title));
        }
        if let Some(selector) = &self.select {
            line("select", inline(selector));
        }
        if let Some(surface) = &self.insert {
            line("insert", inline(surface));
        }
        if let Some(trim) = &self.trim {
            line("trim", word(trim));
        }
        if let Some(lights) = &self.set_light {
            let light = |(name, [r, g, b]): (&String, &[f32; 3])| {
                // Shortest numbers that are read back to the same bits.
                format!("{} = [{r:?}, {g:?}, {b:?}]", word(name))
            };
            let lights: Vec<String> = lights.iter().map(light).collect();
            line("set_light", format!("{{ {} }}", lights.join(", ")));
        }
        if !self.then.is_empty() {
            line("then", inline(&Value::from(self.then.clone())));
        }
        text
    }
}

/// A value of JSON as one of TOML, on one line; keys in alphabetical order. What TOML has not, as
/// null, is left to its reader, who refuses it.
fn inline(value: &Value) -> String {
    match value {
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(inline).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Object(entries) if entries.is_empty() => "{}".to_owned(),
        Value::Object(entries) => {
            let entries: BTreeMap<&String, &Value> = entries.iter().collect();
            let entries = entries.iter().map(|(key, value)| {
                let is_bare = !key.is_empty()
                    && (key.bytes()).all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-');
                let key = if is_bare {
                    (*key).clone()
                } else {
                    inline(&Value::from(key.as_str()))
                };
                format!("{key} = {}", inline(value))
            });
            let entries: Vec<String> = entries.collect();
            format!("{{ {} }}", entries.join(", "))
        }
        // A string of JSON is one of TOML, too; numbers are the shortest of their value.
        _ => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_survive_the_way_through_toml() {
        let value = json!({
            "select": { "any": [{ "sphere": { "centre": [0.1, -2.5e-7, 3], "radius": 1e16 } }] },
            "then": ["remove", { "a key": "quo\"te\\\n\u{1}ü" }],
        });
        let step: Step = serde_json::from_value(value).unwrap();
        #[derive(Deserialize)]
        struct File {
            step: Vec<Step>,
        }
        let file = eagpt_scene::script::ScriptFile::new("s".as_ref(), step.toml().into_bytes());
        let read: File = file.unwrap().parse().unwrap();
        assert_eq!(read.step, [step]);
    }

    #[test]
    fn files_are_not_named() {
        let import = json!({ "import": { "file": "/etc/passwd" } });
        assert!(serde_json::from_value::<Step>(import).is_err());
    }
}

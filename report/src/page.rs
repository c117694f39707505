//! The page: template, style and script, all in one file.

use crate::error::Result;
use minijinja::value::{Serde, Value};
use minijinja::{AutoEscape, Environment, context};

/// The page without its content.
const TEMPLATE: &str = include_str!("../page/report.html");
/// How it looks, on displays and on paper.
const STYLE: &str = include_str!("../page/style.css");
/// Behaviour of sliders and buttons; the page is readable without.
const SCRIPT: &str = include_str!("../page/script.js");

/// Fills the page with what [`crate::gather`] has found.
///
/// # Errors
/// [`crate::ReportError::Page`] if the template cannot take the content.
pub(crate) fn render(content: &serde_json::Value) -> Result<String> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template("report", TEMPLATE)?;
    let template = environment.get_template("report")?;
    let content = Value::from(Serde(content));
    Ok(template.render(context! { content, style => STYLE, script => SCRIPT })?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lamps::HEADINGS;
    use serde_json::json;

    #[test]
    fn names_are_escaped_and_an_empty_run_has_a_page() {
        let content = json!({ "title": "<b>room</b>", "warnings": ["a < b"], "conditions": [] });
        let html = render(&content).unwrap();
        assert!(html.contains("&lt;b&gt;room&lt;&#x2f;b&gt;"), "{html}");
        assert!(html.contains("a &lt; b"));
        assert!(!html.contains("http"), "the page must need no network");
        assert!(!html.contains("<h2>Lamps</h2>") && !html.contains("<h2>Mirrors</h2>"));
    }

    #[test]
    fn mirrors_are_a_table() {
        let table = json!({ "headings": ["mirror", "place"], "rows": [["1", "0 < 1"]] });
        let html = render(&json!({ "mirrors": table })).unwrap();
        assert!(html.contains("<h2>Mirrors</h2>"), "{html}");
        assert!(
            html.contains("<th scope=\"row\">1</th><td>0 &lt; 1</td>"),
            "{html}"
        );
    }

    #[test]
    fn lamps_are_a_table() {
        let table =
            |rows: Vec<[String; 10]>| json!({ "lamps": { "headings": HEADINGS, "rows": rows } });
        let none = render(&table(Vec::new())).unwrap();
        assert!(none.contains("<h2>Lamps</h2>") && none.contains("None was found"));
        let row = HEADINGS.map(|heading| format!("{heading} & 1"));
        let html = render(&table(vec![row])).unwrap();
        assert!(html.contains("<th scope=\"row\">lamp &amp; 1</th><td>shape &amp; 1</td>"));
        assert!(html.contains("<th>deviation</th><th>factor</th>"));
    }
}

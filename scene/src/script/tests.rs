use super::value::*;
use super::*;
use glam::Vec3;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    #[serde(default)]
    name: String,
    list: Option<Vec<Inner>>,
    inner: Option<Spanned<Inner>>,
    #[serde(default)]
    table: std::collections::BTreeMap<String, Inner>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Inner {
    radius: Option<Positive>,
    size: Option<Array<Positive, 2>>,
    num: Option<Whole<1, 9>>,
    color: Option<Color>,
    towards: Option<Direction>,
    turn: Option<Rotation>,
}

fn file(text: &str) -> ScriptFile {
    ScriptFile::new(Path::new("a.toml"), text.into()).unwrap()
}

#[test]
fn errors_name_line_key_and_value() {
    for (text, expected) in [
        ("name = ", "line 1: TOML: "),
        ("name = 1", "line 1: name: invalid type: integer `1`"),
        (
            "\nwidth = 1",
            "line 2: width: unknown field `width`, expected one of `name`",
        ),
        (
            "inner = 3",
            "line 1: inner: invalid type: integer `3`, expected a table",
        ),
        (
            "[inner]\nradius = 0",
            "line 2: inner.radius: 0 is not above 0",
        ),
        (
            "inner.radius = inf",
            "line 1: inner.radius: inf is not a finite number",
        ),
        (
            "[inner]\nradius = 1e39",
            "line 2: inner.radius: 1e39 is not a finite number",
        ),
        (
            "inner = {\n size = [1,\n 0] }",
            "line 3: inner.size[1]: 0 is not above 0",
        ),
        (
            "inner.size = [1]",
            "line 1: inner.size: has 1 values, not 2",
        ),
        (
            "inner.size = [1, 2, 3]",
            "line 1: inner.size: has 3 values, not 2",
        ),
        (
            "inner.num = 1.5",
            "line 1: inner.num: 1.5 is not a whole number from 1 to 9",
        ),
        (
            "inner.num = 10",
            "line 1: inner.num: 10 is not a whole number from 1 to 9",
        ),
        (
            "inner.color = [1, nan, 1]",
            "line 1: inner.color[1]: NaN is not a finite number",
        ),
        (
            "inner.color = [1, -2, 1]",
            "line 1: inner.color: -2 is negative",
        ),
        (
            "inner.color = \"red\"",
            "line 1: inner.color: `red` is not a number or [r, g, b]",
        ),
        (
            "inner.color = true",
            "line 1: inner.color: invalid type: boolean `true`",
        ),
        (
            "inner.towards = \"w\"",
            "line 1: inner.towards: `w` is none of x, -x",
        ),
        (
            "inner.towards = [0, 0, 0]",
            "line 1: inner.towards: 0 is the length",
        ),
        (
            "inner.towards = {}",
            "line 1: inner.towards: is a table, not an axis",
        ),
        (
            "[inner.turn]\naxis = \"x\"",
            "line 1: inner.turn: missing field `degrees`",
        ),
        (
            "[inner]\nturn.axis = \"x\"",
            "line 2: inner.turn: missing field `degrees`",
        ),
        (
            "[[list]]\n[[list]]\nnum = 0",
            "line 3: list[1].num: 0 is not a whole",
        ),
        (
            "[[list]]\n[[list]]\nname = 0",
            "line 3: list[1].name: unknown field",
        ),
        (
            "list = [{}, { num = 1 },\n 3]",
            "line 2: list[2]: invalid type",
        ),
        (
            "[table.one]\n[table.two]\nnum = 0",
            "line 3: table.two.num: 0",
        ),
        (
            "[table]\none.num = 1\ntwo.num = 0",
            "line 3: table.two.num: 0",
        ),
        ("\"a\\nb\" = 1", "line 1: a b: unknown field `a b`"),
    ] {
        let file = file(text);
        let message = file.parse::<Keys>().unwrap_err().to_string();
        let expected = format!("a.toml: {expected}");
        assert!(
            message.starts_with(&expected),
            "{text}\n{message}\nexpected {expected}"
        );
        assert!(!message.contains('\n'), "{message}");
    }
    let bytes = vec![b'a', 0xff];
    let error = ScriptFile::new(Path::new("a.toml"), bytes).unwrap_err();
    assert!(error.to_string().starts_with("a.toml: TOML: "), "{error}");
}

#[test]
fn values_are_what_the_text_says() {
    let file = file(
        "[inner]\nradius = 2\nsize = [0x10, 0.5]\nnum = 9.0\ncolor = 0.25\ntowards = \"-Y\"\n\
         turn = { axis = [0, 3, 0], degrees = 180 }\n",
    );
    let keys: Keys = file.parse().unwrap();
    assert!(keys.name.is_empty() && keys.list.is_none() && keys.table.is_empty());
    let inner = keys.inner.unwrap();
    let error = file.error(inner.span(), "does not fit").to_string();
    assert_eq!(error, "a.toml: line 1: inner: does not fit");
    let inner = inner.into_inner();
    assert_eq!(inner.radius.map(f64::from), Some(2.0));
    assert_eq!(inner.size.map(<[f32; 2]>::from), Some([16.0, 0.5]));
    assert_eq!(inner.num.map(u32::from), Some(9));
    assert_eq!(inner.color, Some(Color(Vec3::splat(0.25))));
    assert_eq!(inner.towards, Some(Direction(Vec3::NEG_Y)));
    let turned = glam::Quat::from(inner.turn.unwrap()) * Vec3::X;
    assert!(turned.distance(Vec3::NEG_X) < 1e-6, "{turned}");
}

#[test]
fn one_alternative_is_there() {
    assert_eq!(one_of([("a", None), ("b", Some(2))]), Ok(2));
    let none = one_of::<u8, 2>([("a", None), ("b", None)]).unwrap_err();
    assert_eq!(none, "one of a, b is missing");
    let both = one_of([("a", Some(1)), ("b", Some(2))]).unwrap_err();
    assert_eq!(both, "`b` is one too many: only one of a, b");
}

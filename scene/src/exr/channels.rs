//! Selection of the channels of an EXR file that hold a colour or a value.

use crate::error::{Result, SceneError};
use crate::words::listed;
use ::exr::meta::header::Header;
use std::path::Path;

/// The chosen channels: their part of the file and, for each wanted channel, its index in that
/// part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Selection<const C: usize> {
    pub(super) header: usize,
    pub(super) channels: [usize; C],
}

impl Selection<3> {
    /// Whether one channel stands for all three.
    pub(super) fn is_grey(&self) -> bool {
        let [first, second, third] = self.channels;
        first == second && second == third
    }
}

/// The channels of one layer of one part.
struct Group {
    header: usize,
    layer: String,
    /// Lower-case name without the layer, and index in the part.
    channels: Vec<(String, usize)>,
}

impl Group {
    fn find(&self, names: &[&str]) -> Option<usize> {
        let found = |(name, _): &&(String, usize)| names.contains(&name.as_str());
        self.channels
            .iter()
            .find(found)
            .map(|(_, channel)| *channel)
    }

    fn rgb(&self) -> Option<[usize; 3]> {
        Some([
            self.find(&["r", "red"])?,
            self.find(&["g", "green"])?,
            self.find(&["b", "blue"])?,
        ])
    }

    fn xyz(&self) -> Option<[usize; 3]> {
        Some([self.find(&["x"])?, self.find(&["y"])?, self.find(&["z"])?])
    }

    /// The only channel besides opacity; opacity itself if there is nothing else.
    fn lone(&self) -> Option<usize> {
        match self.channels.as_slice() {
            [(_, only)] => Some(*only),
            [(a, alpha), (b, other)] | [(b, other), (a, alpha)] if a == "a" && b != "a" => {
                debug_assert_ne!(alpha, other);
                Some(*other)
            }
            _ => None,
        }
    }
}

/// The three channels of a colour or a vector.
///
/// # Errors
/// [`SceneError::Invalid`] that lists the channels found.
pub(super) fn select_rgb(path: &Path, headers: &[Header]) -> Result<Selection<3>> {
    let groups = groups(headers);
    pick(&groups, Group::rgb)
        .or_else(|| pick(&groups, Group::xyz))
        .or_else(|| pick_lone(&groups).map(Selection::repeated))
        .ok_or_else(|| missing(path, "R, G, B", headers))
}

/// The one channel of a mask, an opacity or a depth.
///
/// # Errors
/// [`SceneError::Invalid`] that lists the channels found.
pub(super) fn select_single(path: &Path, headers: &[Header]) -> Result<Selection<1>> {
    let groups = groups(headers);
    let first = |found: Option<[usize; 3]>| found.map(|[first, ..]| [first]);
    pick_lone(&groups)
        .or_else(|| pick(&groups, |group| first(group.rgb())))
        .or_else(|| pick(&groups, |group| first(group.xyz())))
        .or_else(|| pick(&groups, |group| Some([group.find(&["y", "z", "v", "a"])?])))
        .ok_or_else(|| missing(path, "single value", headers))
}

impl Selection<1> {
    fn repeated(self) -> Selection<3> {
        Selection {
            header: self.header,
            channels: [self.channels[0]; 3],
        }
    }
}

fn pick<const C: usize>(
    groups: &[Group],
    channels: impl Fn(&Group) -> Option<[usize; C]>,
) -> Option<Selection<C>> {
    groups.iter().find_map(|group| {
        Some(Selection {
            header: group.header,
            channels: channels(group)?,
        })
    })
}

/// A lone channel is one only if the file has no other layer.
fn pick_lone(groups: &[Group]) -> Option<Selection<1>> {
    match groups {
        [only] => pick(groups, |_| only.lone().map(|channel| [channel])),
        _ => None,
    }
}

/// All channels by layer, the layers most likely meant first.
fn groups(headers: &[Header]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (header_index, header) in headers.iter().enumerate() {
        for (index, channel) in header.channels.list.iter().enumerate() {
            let (layer, name) = layer_and_name(headers, header, &channel.name.to_string());
            let entry = (name.to_lowercase(), index);
            let same = |group: &&mut Group| group.header == header_index && group.layer == layer;
            match groups.iter_mut().find(same) {
                Some(group) => group.channels.push(entry),
                None => groups.push(Group {
                    header: header_index,
                    layer,
                    channels: vec![entry],
                }),
            }
        }
    }
    groups.sort_by_key(|group| {
        let last = group.layer.rsplit('.').next().unwrap_or_default();
        match last {
            "" => 0,
            _ if last.eq_ignore_ascii_case("combined") => 1,
            _ => 2,
        }
    });
    groups
}

/// The name of the layer and of the channel in it; the parts of a file with many parts are layers
/// too.
fn layer_and_name(headers: &[Header], header: &Header, full: &str) -> (String, String) {
    let (layer, name) = full.rsplit_once('.').unwrap_or(("", full));
    let part = header.own_attributes.layer_name.as_ref();
    match part.filter(|_| headers.len() > 1) {
        Some(part) if layer.is_empty() => (part.to_string(), name.to_owned()),
        Some(part) => (format!("{part}.{layer}"), name.to_owned()),
        None => (layer.to_owned(), name.to_owned()),
    }
}

fn missing(path: &Path, wanted: &str, headers: &[Header]) -> SceneError {
    /// Enough to recognise a file by; a render with all passes has hundreds.
    const MAX_LISTED: usize = 24;
    let mut names: Vec<String> = Vec::new();
    for header in headers {
        for channel in &header.channels.list {
            let (layer, name) = layer_and_name(headers, header, &channel.name.to_string());
            let full = if layer.is_empty() {
                name
            } else {
                format!("{layer}.{name}")
            };
            names.push(full.escape_default().to_string());
        }
    }
    let problem = format!("no {wanted} among {}", listed(&names, MAX_LISTED));
    SceneError::invalid(path, "channels", problem)
}

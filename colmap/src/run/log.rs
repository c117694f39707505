//! Progress parsed from COLMAP's log.

use super::Done;

/// A call of the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ColmapStep {
    Features,
    Matches,
    Model,
}

impl ColmapStep {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Features => "features",
            Self::Matches => "matches",
            Self::Model => "model",
        }
    }

    /// Progress stated by a line; versions before 3.9 have no prefix, later ones that of glog.
    pub(super) fn done(self, line: &str) -> Option<Done> {
        let after = |marker: &str| line.split_once(marker).map(|(_, rest)| rest);
        match self {
            // "Processed file [3/96]"
            Self::Features => fraction(after("Processed file [")?),
            // "Matching block [1/2, 2/2]" or "Processing block [1/2, 2/2]" count rows and columns;
            // "Matching image [3/96]" images.
            Self::Matches => {
                let rest = after("block [")
                    .or_else(|| after("Matching image ["))
                    .or_else(|| after("Processing image ["))?;
                let first = fraction(rest)?;
                match rest.split_once(", ").and_then(|(_, rest)| fraction(rest)) {
                    Some(second) => Some(Done {
                        done: first
                            .done
                            .checked_sub(1)?
                            .checked_mul(second.total)?
                            .checked_add(second.done)?,
                        total: first.total.checked_mul(second.total)?,
                    }),
                    None => Some(first),
                }
            }
            Self::Model => None,
        }
    }
}

/// The image count of a line like "Registering image #34 (66)" or "… (num_reg_frames=66)".
pub(super) fn num_registered(line: &str) -> Option<u64> {
    let (_, rest) = line.split_once("Registering image #")?;
    let (_, rest) = rest.split_once('(')?;
    let number = rest.split_once(')')?.0;
    number.rsplit('=').next()?.parse().ok()
}

/// "3/96]…" or "3/96, …".
fn fraction(text: &str) -> Option<Done> {
    let (done, rest) = text.split_once('/')?;
    let end = rest
        .find(|c: char| !c.is_ascii_digit())
        .unwrap_or(rest.len());
    let (done, total) = (done.parse().ok()?, rest[..end].parse().ok()?);
    (done <= total).then_some(Done { done, total })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_old_and_new_versions_are_understood() {
        let done = |step: ColmapStep, line: &str| step.done(line).map(|d| (d.done, d.total));
        for (step, line, wanted) in [
            (ColmapStep::Features, "Processed file [3/96]", Some((3, 96))),
            (
                ColmapStep::Features,
                "I1121 15:13 feature_extraction.cc:254] Processed file [96/96]",
                Some((96, 96)),
            ),
            (
                ColmapStep::Matches,
                "Matching block [2/3, 1/3] in 74.324s",
                Some((4, 9)),
            ),
            (
                ColmapStep::Matches,
                "I1121 pairing.cc:168] Processing block [1/2, 2/2]",
                Some((2, 4)),
            ),
            (
                ColmapStep::Matches,
                "Matching image [7/96] in 0.1s",
                Some((7, 96)),
            ),
            (ColmapStep::Features, "Processed file [x/96]", None),
            (ColmapStep::Matches, "Matching block [0/2, 1/2]", None),
            (ColmapStep::Model, "Registering image #34 (66)", None),
        ] {
            assert_eq!(done(step, line), wanted, "{line}");
        }
        assert_eq!(num_registered("Registering image #34 (66)"), Some(66));
        assert_eq!(
            num_registered("I1121 Registering image #3 (num_reg_frames=7)"),
            Some(7)
        );
        assert_eq!(num_registered("Registering image"), None);
    }
}

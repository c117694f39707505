//! Time stamps: the Gregorian calendar, without time zones.

/// Seconds since 1970-01-01 as RFC 3339 in UTC, to the second.
pub fn rfc3339_from_unix(unix_s: u64) -> String {
    let (date, time) = (date(unix_s / 86_400), time(unix_s));
    format!("{}T{}Z", joined(date, '-', 4), joined(time, ':', 2))
}

/// Seconds since 1970-01-01, in the time of the camera's clock, as EXIF writes them.
pub fn exif_from_unix(unix_s: u64) -> String {
    let (date, time) = (date(unix_s / 86_400), time(unix_s));
    format!("{} {}", joined(date, ':', 4), joined(time, ':', 2))
}

fn joined([a, b, c]: [u64; 3], by: char, digits: usize) -> String {
    format!("{a:0digits$}{by}{b:02}{by}{c:02}")
}

/// Hour, minute, second.
fn time(unix_s: u64) -> [u64; 3] {
    [unix_s / 3600 % 24, unix_s / 60 % 60, unix_s % 60]
}

/// Gregorian year, month and day of a day counted from 1970-01-01 (Howard Hinnant,
/// "chrono-compatible low-level date algorithms"): years begin in March, so that the leap day is
/// the last.
fn date(days: u64) -> [u64; 3] {
    let days = days + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 {
        shifted_month + 3
    } else {
        shifted_month - 9
    };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    [year, month, day]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_moments() {
        for (seconds, text) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_234_567_890, "2009-02-13T23:31:30Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(rfc3339_from_unix(seconds), text);
        }
        assert_eq!(exif_from_unix(1_234_567_890), "2009:02:13 23:31:30");
    }
}

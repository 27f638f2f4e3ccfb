//! File names with places for the frame, as this renderer, other delegates and their exporters write
//! them: `####`, `##.##`, `<F4>`, `$F4`, `${F4}`, `%04d`.

/// No file has more digits.
const MOST_DIGITS: usize = 64;

/// What a place shows of the frame.
enum Digits {
    /// So many digits of the frame rounded down.
    Whole(usize),
    /// So many characters, of which so many are decimals.
    Decimal(usize, usize),
}

/// The places that a name has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Places {
    /// How many there are.
    pub count: usize,
    /// Decimals of the one that shows the fewest.
    pub decimals: usize,
}

/// The places that a name has for the frame.
pub fn places(name: &str) -> Places {
    let mut places = Places::default();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let Some((length, digits)) = place(rest) else {
            rest = &rest[first.len_utf8()..];
            continue;
        };
        let decimals = match digits {
            Digits::Whole(_) => 0,
            Digits::Decimal(_, decimals) => decimals,
        };
        places.decimals = match places.count {
            0 => decimals,
            _ => decimals.min(places.decimals),
        };
        places.count += 1;
        rest = &rest[length..];
    }
    places
}

/// The name with every place filled in.
pub fn expand(name: &str, frame: f64) -> String {
    let mut expanded = String::with_capacity(name.len());
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        match place(rest) {
            Some((length, Digits::Whole(digits))) => {
                expanded += &format!("{:0digits$}", frame.floor() as i64);
                rest = &rest[length..];
            }
            Some((length, Digits::Decimal(width, decimals))) => {
                expanded += &format!("{frame:0width$.decimals$}");
                rest = &rest[length..];
            }
            None => {
                expanded.push(first);
                rest = &rest[first.len_utf8()..];
            }
        }
    }
    expanded
}

/// The place that a text begins with, and its length.
fn place(text: &str) -> Option<(usize, Digits)> {
    let hashes = |text: &str| text.len() - text.trim_start_matches('#').len();
    let whole = hashes(text);
    if whole > 0 {
        let decimals = text[whole..].strip_prefix('.').map_or(0, hashes);
        let length = whole + if decimals > 0 { 1 + decimals } else { 0 };
        return Some((length, Digits::Decimal(length, decimals)));
    }
    // Beginning, whether several digits may follow, and end.
    let forms = [
        ("<F", false, ">"),
        ("${F", false, "}"),
        ("$F", false, ""),
        ("%0", true, "d"),
    ];
    for (begin, several, end) in forms {
        let Some(rest) = text.strip_prefix(begin) else {
            continue;
        };
        let all = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let count = if several { all } else { all.min(1) };
        if rest[count..].starts_with(end) && (count > 0 || !several) {
            let digits = match &rest[..count] {
                "" => 1,
                // More than a thousand are too many, however many.
                long if long.len() > 3 => MOST_DIGITS,
                digits => digits.parse().unwrap_or(MOST_DIGITS).min(MOST_DIGITS),
            };
            return Some((begin.len() + count + end.len(), Digits::Whole(digits)));
        }
    }
    text.starts_with("%d").then_some((2, Digits::Whole(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_of_all_kinds() {
        for (name, expected) in [
            ("a.exr", "a.exr"),
            ("a.####.exr", "a.0012.exr"),
            ("a.##.##.exr", "a.12.50.exr"),
            ("a.###.##.exr", "a.012.50.exr"),
            ("a<F4>.exr", "a0012.exr"),
            ("a<F>.exr", "a12.exr"),
            ("a$F3_$F.exr", "a012_12.exr"),
            ("a${F4}b", "a0012b"),
            ("a%04d%d", "a001212"),
            ("\u{e9}%d", "\u{e9}12"),
            ("#.exr", "12.exr"),
            ("<F44>%0d${F%", "<F44>%0d${F%"),
            ("", ""),
        ] {
            assert_eq!(expand(name, 12.5), expected, "{name}");
        }
        assert_eq!(expand("%05d.####", -1.5), "-0002.-002");
        assert_eq!(expand("%099999999999d", 3.0).len(), MOST_DIGITS);
        assert_eq!(expand("%0100d", 3.0).len(), MOST_DIGITS);
    }

    #[test]
    fn places_are_counted() {
        let counted = |name| {
            let places = places(name);
            (places.count, places.decimals)
        };
        assert_eq!(counted("a.exr"), (0, 0));
        assert_eq!(counted("a.####.exr"), (1, 0));
        assert_eq!(counted("\u{e9}.##.###.exr"), (1, 3));
        assert_eq!(counted("<F4>"), (1, 0));
        assert_eq!(counted("#.#_##.##_%d"), (3, 0));
        assert_eq!(counted("#.#_##.##"), (2, 1));
    }
}

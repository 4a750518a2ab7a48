//! Formats numbers and system messages for people: counts with their nouns, values without a minus
//! sign before zero, joint values in degrees or millimetres, and operating system errors without
//! their numbers.

/// A count with its noun in the right number: `1 robot`, `2 robots`, `0 entries`.
#[must_use]
pub fn count(n: u64, noun: &str) -> String {
    format!("{n} {}", plural(n, noun))
}

/// The singular or plural of `noun` for a count of `n`.
#[must_use]
pub fn plural(n: u64, noun: &str) -> String {
    if n == 1 {
        return noun.to_owned();
    }
    let hisses = ["s", "x", "ch", "sh"].iter().any(|end| noun.ends_with(end));
    match noun.strip_suffix('y') {
        Some(stem) if !stem.ends_with(['a', 'e', 'i', 'o', 'u']) => format!("{stem}ies"),
        _ if hisses => format!("{noun}es"),
        _ => format!("{noun}s"),
    }
}

/// A value with this many decimals; a value that rounds to zero has no sign.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| matches!(c, '0' | '.')) => rest.to_owned(),
        _ => text,
    }
}

/// Three values with this many decimals each, in brackets.
#[must_use]
pub fn triple(values: [f64; 3], decimals: usize) -> String {
    let [x, y, z] = values.map(|v| fixed(v, decimals));
    format!("({x}, {y}, {z})")
}

/// The unit in which joint values are shown to people.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Number of these units in one radian or one metre.
    pub factor: f64,
    /// Symbol after a value, with a leading space where the unit has one.
    pub symbol: &'static str,
}

impl Unit {
    /// Degrees, for revolute joints.
    pub const DEGREES: Self = Self { factor: 180.0 / std::f64::consts::PI, symbol: "°" };
    /// Millimetres, for prismatic joints.
    pub const MILLIMETRES: Self = Self { factor: 1e3, symbol: " mm" };

    /// The unit of a joint that slides (`true`) or turns (`false`).
    #[must_use]
    pub fn of(slides: bool) -> Self {
        if slides { Self::MILLIMETRES } else { Self::DEGREES }
    }

    /// A value (radians or metres) in this unit with this many decimals and the symbol.
    #[must_use]
    pub fn say(self, value: f64, decimals: usize) -> String {
        fixed(value * self.factor, decimals) + self.symbol
    }

    /// A value and its standard deviation (radians or metres) in this unit, with three decimals
    /// each; a deviation of a whole unit or more has one.
    #[must_use]
    pub fn say_both(self, value: f64, sigma: f64) -> String {
        format!("{} ± {}", self.say(value, 3), self.deviation(sigma))
    }

    /// A standard deviation (radians or metres) in this unit, as it is shown after `±`.
    #[must_use]
    pub fn deviation(self, sigma: f64) -> String {
        self.say(sigma, if sigma * self.factor < 1.0 { 3 } else { 1 })
    }
}

/// A message of the operating system without its error number, such as ` (os error 2)`, which means
/// nothing to users.
#[must_use]
pub fn without_numbers(text: &str) -> String {
    const MARK: &str = " (os error ";
    let (mut out, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(at) = rest.find(MARK) {
        let behind = &rest[at + MARK.len()..];
        let n_digits = behind.bytes().take_while(u8::is_ascii_digit).count();
        let is_number = n_digits > 0 && behind[n_digits..].starts_with(')');
        let (kept, left) =
            if is_number { (at, &behind[n_digits + 1..]) } else { (at + 1, &rest[at + 1..]) };
        out.push_str(&rest[..kept]);
        rest = left;
    }
    out + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nouns_follow_their_numbers() {
        let said = [(1, "error"), (0, "error"), (2, "entry"), (1, "entry"), (3, "bus"), (2, "day")]
            .map(|(n, noun)| count(n, noun));
        assert_eq!(said, ["1 error", "0 errors", "2 entries", "1 entry", "3 buses", "2 days"]);
    }

    #[test]
    fn nothing_has_no_sign() {
        assert_eq!(
            [-0.04, 0.0, -0.06, -0.0, 12.34].map(|v| fixed(v, 1)),
            ["0.0", "0.0", "-0.1", "0.0", "12.3"]
        );
        assert_eq!(fixed(-0.4, 0), "0");
        assert_eq!(fixed(f64::NAN, 1), "NaN");
        assert_eq!(triple([-0.0004, 1.0, -2.5], 3), "(0.000, 1.000, -2.500)");
    }

    #[test]
    fn joints_are_said_in_degrees_or_millimetres_with_their_deviation() {
        let turn = Unit::of(false).say_both(57.483_f64.to_radians(), 0.06_f64.to_radians());
        assert_eq!(turn, "57.483° ± 0.060°");
        assert_eq!(Unit::of(false).deviation(std::f64::consts::PI / 3.0_f64.sqrt()), "103.9°");
        assert_eq!(Unit::of(true).say_both(-0.000_000_1, 0.0005), "0.000 mm ± 0.500 mm");
    }

    #[test]
    fn numbers_of_the_system_are_left_out() {
        let text = "No such file or directory (os error 2); Is a directory (os error 21)";
        assert_eq!(without_numbers(text), "No such file or directory; Is a directory");
        for kept in ["a (os error x)", "a (os error )", " (os error 5", "(os error 5)"] {
            assert_eq!(without_numbers(kept), kept);
        }
    }
}

//! Encodes rows of cells as CSV.

use contract::{Error, Kind, Result};

/// The text of a CSV file: the names of the columns, then a line a row.
///
/// Cells that people chose the text of are guarded by `contract::quote::cell` before they come
/// here; quotes, where a cell needs them, are put here.
///
/// # Errors
/// `Bug` where a row cannot be written.
pub(super) fn csv<const N: usize>(
    columns: [&str; N],
    rows: impl IntoIterator<Item = [String; N]>,
) -> Result<String> {
    let bug = |cause: Box<dyn std::error::Error + Send + Sync>| {
        Error::new(Kind::Bug, "a row of CSV does not encode").because(cause)
    };
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns).map_err(|e| bug(e.into()))?;
    for row in rows {
        writer.write_record(&row).map_err(|e| bug(e.into()))?;
    }
    let bytes = writer.into_inner().map_err(|e| bug(e.into_error().into()))?;
    String::from_utf8(bytes).map_err(|e| bug(e.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::quote;

    #[test]
    fn cells_are_quoted_where_they_need_it_and_are_no_formulas() {
        let row = ["a,b", "say \"no\"", "=1+1", "-1.5"].map(quote::cell);
        let text = csv(["one", "two", "three", "four"], [row]).expect("encodes");
        assert_eq!(text, "one,two,three,four\n\"a,b\",\"say \"\"no\"\"\",'=1+1,-1.5\n");
    }
}

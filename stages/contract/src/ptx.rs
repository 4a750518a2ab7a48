//! What a line of a PTX file says, for those that read it and those that write it.

/// Whether a line is `0 0 0 …`, which in PTX marks a beam without return. Labels of PTX scans have
/// no place for such a line.
#[must_use]
pub fn is_ptx_no_return(line: &[u8]) -> bool {
    let mut n_zeros = 0;
    let mut within = false;
    let mut digits = 0;
    for byte in line {
        match byte {
            b'0' => (within, digits) = (true, digits + 1),
            b'.' | b'-' | b'+' => within = true,
            b' ' | b'\t' | b'\r' if within => {
                if digits == 0 {
                    return false;
                }
                (n_zeros, within, digits) = (n_zeros + 1, false, 0);
                if n_zeros == 3 {
                    return true;
                }
            }
            b' ' | b'\t' => {}
            // `0e0` is zero, too, but no program writes it, so it counts as a point at the scanner.
            _ => return false,
        }
    }
    n_zeros == 2 && digits > 0
}

//! Time of a core, for figures that others on the machine don't lengthen.

/// Time that this thread ran on a core, s: the kernel's own count, which others on the machine don't lengthen.
///
/// # Panics
/// Where there is no `/proc`, as elsewhere than on Linux.
pub fn core_s() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").expect("Linux");
    let nanoseconds = text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok());
    nanoseconds.expect("nanoseconds on a core") * 1e-9
}

//! Searches that whoever waits for them can end.

/// Steps of a search between two questions.
const OFTEN: u32 = 1024;

/// Whether a search may go on; by itself it ends only when it is done.
#[derive(Clone, Copy, Default)]
pub struct Until<'a>(Option<&'a dyn Fn() -> bool>);

impl<'a> Until<'a> {
    /// Until this says so: a deadline that has passed, or that nobody waits any more.
    pub fn over(is_over: &'a dyn Fn() -> bool) -> Self {
        Until(Some(is_over))
    }

    /// Whether it is to end now.
    pub fn is_over(&self) -> bool {
        self.0.is_some_and(|is_over| is_over())
    }

    /// The same, asked only at some steps.
    pub fn is_over_at(&self, step: u32) -> bool {
        step.is_multiple_of(OFTEN) && self.is_over()
    }
}

impl std::fmt::Debug for Until<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(if self.0.is_some() { "Until(over)" } else { "Until(done)" })
    }
}

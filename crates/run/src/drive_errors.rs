//! Which error each drive has, as long as its fault lasts.

use omnibase_cia402::ErrorCode;
use omnibase_robot::signals::{DriveMeasurement, DriveProgress, MAX_WHEELS};

/// What each wheel's drive said of its fault, by its process data, its emergency or when it was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveErrors {
    errors: [ErrorCode; MAX_WHEELS],
    in_fault: [bool; MAX_WHEELS],
}

impl DriveErrors {
    /// A wheel's drive said which fault it has: perhaps before its status word shows that it has one.
    pub fn said(&mut self, wheel: usize, error: ErrorCode) {
        if let Some(known) = self.errors.get_mut(wheel) {
            *known = error;
        }
    }

    /// A fault that is over is forgotten; one that the process data tell is known.
    pub fn look(&mut self, drives: &[DriveMeasurement]) {
        let all = self.errors.iter_mut().zip(&mut self.in_fault);
        for (drive, (error, in_fault)) in drives.iter().zip(all) {
            let is_in_fault = drive.progress == DriveProgress::Fault;
            if *in_fault && !is_in_fault {
                *error = ErrorCode::NONE;
            }
            if drive.error != ErrorCode::NONE {
                *error = drive.error;
            }
            *in_fault = is_in_fault;
        }
    }

    /// The error of a wheel's drive that is in fault; none where it isn't, or didn't say.
    pub fn of(&self, wheel: usize) -> ErrorCode {
        let is_in_fault = self.in_fault.get(wheel).copied().unwrap_or(false);
        if is_in_fault { self.errors[wheel] } else { ErrorCode::NONE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OVERLOAD: ErrorCode = ErrorCode(0x2350);

    fn drives(progress: DriveProgress, error: ErrorCode) -> [DriveMeasurement; 2] {
        [DriveMeasurement::default(), DriveMeasurement { progress, error, ..DriveMeasurement::default() }]
    }

    #[test]
    fn what_a_drive_said_counts_from_its_fault_until_that_is_over() {
        let mut errors = DriveErrors::default();
        let running = drives(DriveProgress::Running, ErrorCode::NONE);
        let fault = drives(DriveProgress::Fault, ErrorCode::NONE);
        errors.look(&running);
        // The emergency comes before the status word.
        errors.said(1, OVERLOAD);
        errors.look(&running);
        assert_eq!(errors.of(1), ErrorCode::NONE, "its fault isn't there yet");
        errors.look(&fault);
        assert_eq!((errors.of(0), errors.of(1)), (ErrorCode::NONE, OVERLOAD));
        errors.look(&running);
        errors.look(&fault);
        assert_eq!(errors.of(1), ErrorCode::NONE, "another fault, of which nothing was said yet");
        errors.said(1, OVERLOAD);
        assert_eq!(errors.of(1), OVERLOAD);
        // What the process data say is newer.
        errors.look(&drives(DriveProgress::Fault, ErrorCode(0x8611)));
        assert_eq!(errors.of(1), ErrorCode(0x8611));
        // A wheel that isn't there has no place.
        errors.said(MAX_WHEELS, OVERLOAD);
        assert_eq!(errors.of(MAX_WHEELS), ErrorCode::NONE);
    }
}

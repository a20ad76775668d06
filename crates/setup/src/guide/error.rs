//! Why a set-up can't go on.

use omnibase_ethercat::wire::LinkError;

use crate::robot_file::RobotFileError;

/// Why a set-up can't go on.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The segment can't be opened.
    #[error("{0}")]
    Open(String),
    /// The bus refuses.
    #[error("{0}")]
    Bus(String),
    /// What drives hold can't be kept, so no jog writes over it.
    #[error("what the drives hold can't be kept, so nothing is written into them: {0}")]
    Unkept(String),
    /// The robot's file.
    #[error("the robot's file can't be written: {0}")]
    Unwritten(String),
    /// An EEPROM is half-written.
    #[error("{0}. The same set-up, taken up again, makes it whole")]
    BrokenOff(String),
    /// The port is broken.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Other drives are there than were found.
    #[error(
        "this set-up found {expected} at position {position}, now there is {found}: plug and power it as it was and take the \
         set-up up again, or begin a new one"
    )]
    Changed {
        /// Position on the bus.
        position: u16,
        /// Who was there.
        expected: String,
        /// Who is.
        found: String,
    },
    /// It was begun with another robot's file.
    #[error(
        "this set-up was begun with the file of a robot with other wheels, or at other places: give that one, or begin anew"
    )]
    OtherRobot,
    /// There are fewer drives than wheels.
    #[error(
        "the file has {wheels} wheels, on the bus are {drives} drives of the profile CiA 402 that may turn one (who is a device of the \
         file, or turns no wheel as was said, isn't counted)"
    )]
    TooFewDrives {
        /// Wheels of the file.
        wheels: usize,
        /// Drives found.
        drives: usize,
    },
    /// The file's devices aren't where it has them.
    #[error(
        "the file's [[device]] tables aren't what is on the bus, so nothing is turned: {0}. Put them right in the file of --robot, or plug \
         and name (`omnibase eeprom alias`) the devices so, and give the same command again"
    )]
    Devices(String),
    /// The file.
    #[error(transparent)]
    File(#[from] RobotFileError),
}

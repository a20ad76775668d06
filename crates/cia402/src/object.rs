//! The profile's objects: index, subindex, type and name (CiA 402-2).

/// A basic data type of CANopen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DataType {
    /// INTEGER8.
    I8,
    /// INTEGER16.
    I16,
    /// INTEGER32.
    I32,
    /// UNSIGNED8.
    U8,
    /// UNSIGNED16.
    U16,
    /// UNSIGNED32.
    U32,
}

impl DataType {
    /// The length in bits.
    pub const fn bit_length(self) -> u8 {
        match self {
            DataType::I8 | DataType::U8 => 8,
            DataType::I16 | DataType::U16 => 16,
            DataType::I32 | DataType::U32 => 32,
        }
    }
}

/// One entry of the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
    /// Type.
    pub data_type: DataType,
    /// The standard's name.
    pub name: &'static str,
}

impl Object {
    /// The length in bits.
    pub const fn bit_length(&self) -> u8 {
        self.data_type.bit_length()
    }

    /// The entry as PDO mapping objects hold it: index, subindex, bit length.
    pub const fn mapping(&self) -> u32 {
        (self.index as u32) << 16 | (self.subindex as u32) << 8 | self.bit_length() as u32
    }

    /// The profile's object at an address.
    pub fn find(index: u16, subindex: u8) -> Option<&'static Object> {
        ALL.iter().find(|object| object.index == index && object.subindex == subindex)
    }
}

macro_rules! objects {
    ($($constant:ident = $index:literal : $subindex:literal $data_type:ident $name:literal;)*) => {
        $(#[doc = $name] pub const $constant: Object =
            Object { index: $index, subindex: $subindex, data_type: DataType::$data_type, name: $name };)*

        /// Every object of this list, by rising address.
        pub const ALL: &[Object] = &[$($constant),*];
    };
}

objects! {
    ERROR_CODE = 0x603F:0 U16 "Error code";
    CONTROL_WORD = 0x6040:0 U16 "Controlword";
    STATUS_WORD = 0x6041:0 U16 "Statusword";
    VL_TARGET_VELOCITY = 0x6042:0 I16 "vl target velocity";
    VL_VELOCITY_DEMAND = 0x6043:0 I16 "vl velocity demand";
    VL_VELOCITY_ACTUAL = 0x6044:0 I16 "vl velocity actual value";
    QUICK_STOP_OPTION = 0x605A:0 I16 "Quick stop option code";
    SHUTDOWN_OPTION = 0x605B:0 I16 "Shutdown option code";
    DISABLE_OPERATION_OPTION = 0x605C:0 I16 "Disable operation option code";
    HALT_OPTION = 0x605D:0 I16 "Halt option code";
    FAULT_REACTION_OPTION = 0x605E:0 I16 "Fault reaction option code";
    MODE_OF_OPERATION = 0x6060:0 I8 "Modes of operation";
    MODE_OF_OPERATION_DISPLAY = 0x6061:0 I8 "Modes of operation display";
    POSITION_DEMAND = 0x6062:0 I32 "Position demand value";
    POSITION_ACTUAL_INTERNAL = 0x6063:0 I32 "Position actual internal value";
    POSITION_ACTUAL = 0x6064:0 I32 "Position actual value";
    FOLLOWING_ERROR_WINDOW = 0x6065:0 U32 "Following error window";
    FOLLOWING_ERROR_TIMEOUT = 0x6066:0 U16 "Following error time out";
    POSITION_WINDOW = 0x6067:0 U32 "Position window";
    POSITION_WINDOW_TIME = 0x6068:0 U16 "Position window time";
    VELOCITY_DEMAND = 0x606B:0 I32 "Velocity demand value";
    VELOCITY_ACTUAL = 0x606C:0 I32 "Velocity actual value";
    VELOCITY_WINDOW = 0x606D:0 U16 "Velocity window";
    VELOCITY_WINDOW_TIME = 0x606E:0 U16 "Velocity window time";
    VELOCITY_THRESHOLD = 0x606F:0 U16 "Velocity threshold";
    VELOCITY_THRESHOLD_TIME = 0x6070:0 U16 "Velocity threshold time";
    TARGET_TORQUE = 0x6071:0 I16 "Target torque";
    MAX_TORQUE = 0x6072:0 U16 "Max torque";
    MAX_CURRENT = 0x6073:0 U16 "Max current";
    TORQUE_DEMAND = 0x6074:0 I16 "Torque demand";
    MOTOR_RATED_CURRENT = 0x6075:0 U32 "Motor rated current";
    MOTOR_RATED_TORQUE = 0x6076:0 U32 "Motor rated torque";
    TORQUE_ACTUAL = 0x6077:0 I16 "Torque actual value";
    CURRENT_ACTUAL = 0x6078:0 I16 "Current actual value";
    DC_LINK_VOLTAGE = 0x6079:0 U32 "DC link circuit voltage";
    TARGET_POSITION = 0x607A:0 I32 "Target position";
    HOME_OFFSET = 0x607C:0 I32 "Home offset";
    SOFTWARE_POSITION_LIMIT_MIN = 0x607D:1 I32 "Software position limit: minimum";
    SOFTWARE_POSITION_LIMIT_MAX = 0x607D:2 I32 "Software position limit: maximum";
    POLARITY = 0x607E:0 U8 "Polarity";
    MAX_PROFILE_VELOCITY = 0x607F:0 U32 "Max profile velocity";
    MAX_MOTOR_SPEED = 0x6080:0 U32 "Max motor speed";
    PROFILE_VELOCITY = 0x6081:0 U32 "Profile velocity";
    PROFILE_ACCELERATION = 0x6083:0 U32 "Profile acceleration";
    PROFILE_DECELERATION = 0x6084:0 U32 "Profile deceleration";
    QUICK_STOP_DECELERATION = 0x6085:0 U32 "Quick stop deceleration";
    MOTION_PROFILE_TYPE = 0x6086:0 I16 "Motion profile type";
    TORQUE_SLOPE = 0x6087:0 U32 "Torque slope";
    ENCODER_INCREMENTS = 0x608F:1 U32 "Position encoder resolution: encoder increments";
    ENCODER_REVOLUTIONS = 0x608F:2 U32 "Position encoder resolution: motor revolutions";
    GEAR_MOTOR_REVOLUTIONS = 0x6091:1 U32 "Gear ratio: motor revolutions";
    GEAR_SHAFT_REVOLUTIONS = 0x6091:2 U32 "Gear ratio: shaft revolutions";
    FEED = 0x6092:1 U32 "Feed constant: feed";
    FEED_SHAFT_REVOLUTIONS = 0x6092:2 U32 "Feed constant: shaft revolutions";
    HOMING_METHOD = 0x6098:0 I8 "Homing method";
    HOMING_SPEED_SWITCH = 0x6099:1 U32 "Homing speeds: during search for switch";
    HOMING_SPEED_ZERO = 0x6099:2 U32 "Homing speeds: during search for zero";
    HOMING_ACCELERATION = 0x609A:0 U32 "Homing acceleration";
    POSITION_OFFSET = 0x60B0:0 I32 "Position offset";
    VELOCITY_OFFSET = 0x60B1:0 I32 "Velocity offset";
    TORQUE_OFFSET = 0x60B2:0 I16 "Torque offset";
    TOUCH_PROBE_FUNCTION = 0x60B8:0 U16 "Touch probe function";
    TOUCH_PROBE_STATUS = 0x60B9:0 U16 "Touch probe status";
    TOUCH_PROBE_1_POSITIVE = 0x60BA:0 I32 "Touch probe 1 positive edge";
    TOUCH_PROBE_1_NEGATIVE = 0x60BB:0 I32 "Touch probe 1 negative edge";
    INTERPOLATION_DATA = 0x60C1:1 I32 "Interpolation data record: 1st set-point";
    INTERPOLATION_PERIOD = 0x60C2:1 U8 "Interpolation time period: value";
    INTERPOLATION_EXPONENT = 0x60C2:2 I8 "Interpolation time period: index";
    POSITIVE_TORQUE_LIMIT = 0x60E0:0 U16 "Positive torque limit value";
    NEGATIVE_TORQUE_LIMIT = 0x60E1:0 U16 "Negative torque limit value";
    FOLLOWING_ERROR_ACTUAL = 0x60F4:0 I32 "Following error actual value";
    POSITION_DEMAND_INTERNAL = 0x60FC:0 I32 "Position demand internal value";
    DIGITAL_INPUTS = 0x60FD:0 U32 "Digital inputs";
    DIGITAL_OUTPUTS = 0x60FE:1 U32 "Digital outputs: physical outputs";
    DIGITAL_OUTPUTS_MASK = 0x60FE:2 U32 "Digital outputs: bit mask";
    TARGET_VELOCITY = 0x60FF:0 I32 "Target velocity";
    MOTOR_TYPE = 0x6402:0 U16 "Motor type";
    SUPPORTED_MODES = 0x6502:0 U32 "Supported drive modes";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_rises_and_is_found_by_address() {
        assert!(
            ALL.windows(2).all(|pair| (pair[0].index, pair[0].subindex) < (pair[1].index, pair[1].subindex))
        );
        assert_eq!(Object::find(0x6064, 0), Some(&POSITION_ACTUAL));
        assert_eq!(Object::find(0x6064, 1), None);
    }

    /// The SGDV's default map (0x1600, 0x1A00), with the lengths its manual gives.
    #[test]
    fn lengths_agree_with_the_default_map_of_the_sgdv() {
        for (index, subindex, bits) in [
            (0x6040, 0, 16),
            (0x607A, 0, 32),
            (0x60FF, 0, 32),
            (0x6071, 0, 16),
            (0x6072, 0, 16),
            (0x6060, 0, 8),
            (0x60C1, 1, 32),
            (0x6041, 0, 16),
            (0x6064, 0, 32),
            (0x6077, 0, 16),
            (0x60F4, 0, 32),
            (0x6061, 0, 8),
            (0x60B9, 0, 16),
            (0x60BA, 0, 32),
            (0x606C, 0, 32),
        ] {
            assert_eq!(Object::find(index, subindex).unwrap().bit_length(), bits, "{index:04x}:{subindex}");
        }
        assert_eq!(TARGET_POSITION.mapping(), 0x607A_0020);
    }
}

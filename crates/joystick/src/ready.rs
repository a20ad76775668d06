//! Which ready map belongs to a device, by its USB vendor and product.

use omnibase_robot::config::ReadyMapName;

/// Vendor, product and map.
const KNOWN: [(u16, u16, ReadyMapName); 16] = [
    // Thrustmaster
    (0x044F, 0xB106, ReadyMapName::TFlightStickX),
    // Microsoft, as xpad knows them: 360 (wired, v2, receivers), One, One S, Elite, Series
    (0x045E, 0x028E, ReadyMapName::Xbox),
    (0x045E, 0x028F, ReadyMapName::Xbox),
    (0x045E, 0x0291, ReadyMapName::Xbox),
    (0x045E, 0x0719, ReadyMapName::Xbox),
    (0x045E, 0x02D1, ReadyMapName::Xbox),
    (0x045E, 0x02DD, ReadyMapName::Xbox),
    (0x045E, 0x02E3, ReadyMapName::Xbox),
    (0x045E, 0x02EA, ReadyMapName::Xbox),
    (0x045E, 0x0B00, ReadyMapName::Xbox),
    (0x045E, 0x0B12, ReadyMapName::Xbox),
    // Sony: DualShock 4 (two makes, and its receiver), DualSense, DualSense Edge
    (0x054C, 0x05C4, ReadyMapName::Playstation),
    (0x054C, 0x09CC, ReadyMapName::Playstation),
    (0x054C, 0x0BA0, ReadyMapName::Playstation),
    (0x054C, 0x0CE6, ReadyMapName::Playstation),
    (0x054C, 0x0DF2, ReadyMapName::Playstation),
];

/// The map that belongs to a vendor and product.
pub fn map_for(vendor_id: u16, product_id: u16) -> Option<ReadyMapName> {
    KNOWN.iter().find(|known| (known.0, known.1) == (vendor_id, product_id)).map(|known| known.2)
}

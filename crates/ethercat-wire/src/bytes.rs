//! Little-endian fields at fixed offsets, as every EtherCAT structure has them.

/// The `u16` at `offset`. Panics where the slice is too short: callers check lengths once, before.
#[inline]
pub fn u16_at(bytes: &[u8], offset: usize) -> u16 {
    let mut number = [0; 2];
    number.copy_from_slice(&bytes[offset..offset + 2]);
    u16::from_le_bytes(number)
}

/// The `u32` at `offset`. Panics where the slice is too short: callers check lengths once, before.
#[inline]
pub fn u32_at(bytes: &[u8], offset: usize) -> u32 {
    let mut number = [0; 4];
    number.copy_from_slice(&bytes[offset..offset + 4]);
    u32::from_le_bytes(number)
}

/// The `u64` at `offset`. Panics where the slice is too short: callers check lengths once, before.
#[inline]
pub fn u64_at(bytes: &[u8], offset: usize) -> u64 {
    let mut number = [0; 8];
    number.copy_from_slice(&bytes[offset..offset + 8]);
    u64::from_le_bytes(number)
}

/// Writes `value` at `offset`. Panics where the slice is too short.
#[inline]
pub fn put_u16(bytes: &mut [u8], offset: usize, value: u16) {
    bytes[offset..offset + 2].copy_from_slice(&value.to_le_bytes());
}

/// Writes `value` at `offset`. Panics where the slice is too short.
#[inline]
pub fn put_u32(bytes: &mut [u8], offset: usize, value: u32) {
    bytes[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
}

/// Writes `value` at `offset`. Panics where the slice is too short.
#[inline]
pub fn put_u64(bytes: &mut [u8], offset: usize, value: u64) {
    bytes[offset..offset + 8].copy_from_slice(&value.to_le_bytes());
}

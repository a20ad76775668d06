//! Typed places in a dictionary: an offset that was checked once.

use super::{DataType, Dictionary};
use core::marker::PhantomData;
use omnibase_ethercat_wire::coe::ObjectAddress;

/// A number that a dictionary holds.
pub trait Scalar: Copy {
    /// The CoE type.
    const DATA_TYPE: DataType;
    /// Reads it at `offset`.
    fn load(arena: &[u8], offset: usize) -> Self;
    /// Writes it at `offset`.
    fn store(self, arena: &mut [u8], offset: usize);
}

macro_rules! scalars {
    ($($number:ty, $size:literal, $data_type:ident;)*) => {
        $(impl Scalar for $number {
            const DATA_TYPE: DataType = DataType::$data_type;
            #[inline]
            fn load(arena: &[u8], offset: usize) -> Self {
                let mut bytes = [0; $size];
                bytes.copy_from_slice(&arena[offset..offset + $size]);
                <$number>::from_le_bytes(bytes)
            }
            #[inline]
            fn store(self, arena: &mut [u8], offset: usize) {
                arena[offset..offset + $size].copy_from_slice(&self.to_le_bytes());
            }
        })*
    };
}
scalars! {
    u8, 1, UNSIGNED8;
    i8, 1, INTEGER8;
    u16, 2, UNSIGNED16;
    i16, 2, INTEGER16;
    u32, 4, UNSIGNED32;
    i32, 4, INTEGER32;
}

/// Where a number of type `T` lies in the dictionary that gave this field.
#[derive(Clone, Copy, Debug)]
pub struct Field<T> {
    offset: usize,
    number: PhantomData<T>,
}

impl Dictionary {
    /// The field at this address; `None` where there is no such entry or it has another type.
    pub fn field<T: Scalar>(&self, index: u16, subindex: u8) -> Option<Field<T>> {
        let entry = self.entry(ObjectAddress::new(index, subindex))?;
        (entry.data_type == T::DATA_TYPE).then(|| Field { offset: entry.offset(), number: PhantomData })
    }

    /// The number in a field of this dictionary.
    #[inline]
    pub fn get<T: Scalar>(&self, field: Field<T>) -> T {
        T::load(&self.values, field.offset)
    }

    /// Sets the number in a field of this dictionary.
    #[inline]
    pub fn set<T: Scalar>(&mut self, field: Field<T>, number: T) {
        number.store(&mut self.values, field.offset);
    }
}

//! Any bytes as an SII image: read without a panic; a reading without problems survives being written.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat_wire::sii::Image;

fuzz_target!(|bytes: &[u8]| {
    let Ok((mut image, _)) = Image::parse(bytes) else { return };
    // Without padding: the header may announce 8 MiB.
    image.header.size_kibit_less_one = 0;
    image.header.raw = image.header.bytes();
    for index in 0..=255 {
        let _ = image.string(index);
    }
    let (again, _) = Image::parse(&image.emit()).expect("what was written is long enough");
    assert_eq!(again.header, image.header);
    assert_eq!(again.tx_pdos, image.tx_pdos);
    assert_eq!(again.rx_pdos, image.rx_pdos);
    assert_eq!(again.sync_managers, image.sync_managers);
    assert_eq!(again.dc_modes, image.dc_modes);
});

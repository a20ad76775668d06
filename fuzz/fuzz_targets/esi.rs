//! Any bytes as an ESI file: read without a panic, and whatever devices come of it make images that can be read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_esi::{Assembly, EsiFile, image};
use omnibase_ethercat_wire::sii::Image;

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = EsiFile::parse(bytes) else { return };
    for device in &file.devices {
        let _ = Image::parse(&image::eeprom(device, 1).emit()).expect("an image has its header");
        let modules = file.modules.iter().take(3).collect();
        let Ok(assembly) = Assembly::new(device, modules) else { continue };
        let (outputs, _) = assembly.default_pdos(true);
        assert!(outputs.iter().all(|pdo| pdo.sync_manager.is_some()));
        let _ = (assembly.commands(), assembly.objects(), assembly.doubts());
        let _ = image::with_modules(&assembly, 1).emit();
    }
});

//! The signals of a SubDevice that drives no wheel: where each stands in its process data, and its number.

use super::devices::Device;
use crate::config::{find_object as find, has_padding, length_with_padding, *};
use crate::registry::PeripheralDefaults;
use crate::signals::column_name;

impl Device<'_> {
    pub(super) fn inputs(
        &mut self,
        defaults: &PeripheralDefaults,
        axis: Option<&AxisPlan>,
        pdos: &[PdoPlan],
    ) -> Option<Vec<InputPlan>> {
        let own = self.own.input.iter().enumerate().map(|(n, table)| {
            let InputTable { name, object, byte, bit, kind, unit, scale, offset, simulated } = table;
            let written = Written {
                name,
                object,
                byte: *byte,
                bit: *bit,
                kind: *kind,
                unit,
                scale: *scale,
                offset: *offset,
            };
            let key = format!("input[{n}]");
            let (name, unit, coding) = self.signal(&key, "inputs", &written, pdos)?;
            let reason = "the process data can't hold it";
            self.held(&format!("{key}.simulated"), *simulated, &coding, reason)?;
            self.is_simulated(&format!("{key}.simulated"), *simulated, &coding, pdos)?;
            Some(InputPlan { name, unit, coding: Some(coding), simulated: *simulated })
        });
        let own: Vec<Option<InputPlan>> = own.collect();
        let of_axis = axis.map(AxisPlan::signals).unwrap_or_default();
        defaults.input.iter().cloned().chain(of_axis).map(Some).chain(own).collect()
    }

    pub(super) fn outputs(
        &mut self,
        defaults: &PeripheralDefaults,
        pdos: &[PdoPlan],
    ) -> Option<Vec<OutputPlan>> {
        let own = self.own.output.iter().enumerate().map(|(n, table)| {
            let OutputTable { name, object, byte, bit, kind, unit, scale, offset, on_stop } = table;
            let written = Written {
                name,
                object,
                byte: *byte,
                bit: *bit,
                kind: *kind,
                unit,
                scale: *scale,
                offset: *offset,
            };
            let key = format!("output[{n}]");
            let (name, unit, coding) = self.signal(&key, "outputs", &written, pdos)?;
            let on_stop = on_stop.unwrap_or(0.0);
            let reason = "the process data can't hold it, and the output is it when the robot stops";
            self.held(&format!("{key}.on_stop"), Some(on_stop), &coding, reason)?;
            Some(OutputPlan { name, unit, coding: Some(coding), on_stop })
        });
        let own: Vec<Option<OutputPlan>> = own.collect();
        defaults.output.iter().cloned().map(Some).chain(own).collect()
    }

    /// What a simulated SubDevice says stands in its objects: there is nothing in the padding between them.
    fn is_simulated(
        &mut self,
        key: &str,
        value: Option<f64>,
        coding: &Coding,
        pdos: &[PdoPlan],
    ) -> Option<()> {
        if value.is_none() || !has_padding(pdos, coding.bit_range()) {
            return Some(());
        }
        let reason = "it stands in padding, which a simulated SubDevice leaves at 0";
        self.check.report(ProblemKind::Contradiction, &self.setting(key), reason).value =
            value.map(|value| value.to_string());
        None
    }

    /// A value that the process data must be able to hold; `None` where they aren't.
    fn held(&mut self, key: &str, value: Option<f64>, coding: &Coding, reason: &str) -> Option<()> {
        let Some(value) = value.filter(|value| !coding.holds(*value)) else { return Some(()) };
        let [least, greatest] = coding.values();
        let problem = self.check.report(ProblemKind::OutOfRange, &self.setting(key), reason);
        problem.value = Some(value.to_string());
        problem.limit = Some(format!("{least} to {greatest}"));
        None
    }

    fn signal(
        &mut self,
        key: &str,
        map: &str,
        written: &Written<'_>,
        pdos: &[PdoPlan],
    ) -> Option<(String, String, Coding)> {
        let table = self.setting(key);
        let setting = |part: &str| format!("{table}.{part}");
        let name = self.check.signal_name(written.name.as_deref(), &setting("name"));
        let object = self.check.need(
            written.object.as_ref(),
            &setting("object"),
            "it says where the signal stands",
        )?;
        let (index, subindex) = match parse_object(object) {
            Ok(object) => object,
            Err(error) => {
                self.check.report(ProblemKind::WrongType, &setting("object"), error).value =
                    Some(format!("\"{object}\""));
                return None;
            }
        };
        let Some((first, length)) = find(pdos, index, subindex).filter(|_| index != 0) else {
            let reason = format!("the object isn't among `{map}`");
            let shown = pdos.iter().flat_map(|pdo| &pdo.entries).filter(|entry| entry.index != 0);
            let shown: Vec<String> = shown.map(ToString::to_string).collect();
            let problem = self.check.report(ProblemKind::Missing, &setting("object"), reason);
            problem.value = Some(format!("\"{object}\""));
            problem.limit =
                Some(if shown.is_empty() { format!("an object of `{map}`") } else { shown.join(" ") });
            return None;
        };
        let (bit, bits, kind) = match written.byte {
            Some(byte) => {
                let room = length_with_padding(pdos, index, subindex);
                let (at, bits, kind) = self.at_byte(byte, written, room, &setting)?;
                (first + at, bits, kind)
            }
            None => self.in_object(first, length, written, &setting)?,
        };
        let scale = written.scale.unwrap_or(1.0);
        let offset = written.offset.unwrap_or(0.0);
        for (value, setting, is_sound) in [
            (scale, setting("scale"), scale.is_finite() && scale != 0.0),
            (offset, setting("offset"), offset.is_finite()),
        ] {
            if !is_sound {
                let problem =
                    self.check.report(ProblemKind::OutOfRange, &setting, "values can't be scaled by it");
                problem.value = Some(value.to_string());
                problem.limit = Some("a finite number, the scale not 0".into());
                return None;
            }
        }
        let unit = self.check.unit(written.unit.as_deref(), &setting("unit"))?;
        Some((name?, unit, Coding { bit, bits, kind, scale, offset }))
    }

    /// The whole object, or one bit of it: its first bit in the process data, how many they are, and their type.
    fn in_object(
        &mut self,
        first: u32,
        length: u8,
        written: &Written<'_>,
        setting: &dyn Fn(&str) -> String,
    ) -> Option<(u32, u8, SignalType)> {
        let (bit, bits) = match written.bit {
            None => (first, length),
            Some(bit) if bit < length => (first + u32::from(bit), 1),
            Some(bit) => {
                self.beyond(&setting("bit"), "the object has fewer bits", bit, length - 1);
                return None;
            }
        };
        let of_one_bit = (bits == 1).then_some(SignalType::Bool);
        let reason = "it says how its bits are a number";
        let kind = self.check.need(written.kind.or(of_one_bit), &setting("type"), reason)?;
        let fits = match kind {
            SignalType::F32 | SignalType::Bool => bits == kind.bits(),
            _ => bits <= kind.bits(),
        };
        if !fits {
            let reason = "the object has another length";
            let problem = self.check.report(ProblemKind::Contradiction, &setting("type"), reason);
            problem.value = Some(format!("{} bits", kind.bits()));
            problem.limit = Some(format!("a type of {bits} bits"));
            return None;
        }
        Some((bit, bits, kind))
    }

    /// A number that begins at a byte of an object, or one bit of that byte; `room` is how many bits belong to the
    /// object. Its first bit in the object, how many they are, and their type.
    fn at_byte(
        &mut self,
        byte: u8,
        written: &Written<'_>,
        room: u32,
        setting: &dyn Fn(&str) -> String,
    ) -> Option<(u32, u8, SignalType)> {
        let bit = written.bit.unwrap_or(0);
        if bit > 7 {
            self.beyond(&setting("bit"), "a byte has fewer bits", bit, 7);
            return None;
        }
        let of_one_bit = written.bit.is_some().then_some(SignalType::Bool);
        let reason = "it says how many bytes are a number";
        let kind = self.check.need(written.kind.or(of_one_bit), &setting("type"), reason)?;
        if (kind == SignalType::Bool) != written.bit.is_some() {
            let reason = "`bit` is of a `bool`, and a `bool` in a byte has its `bit`";
            self.check.report(ProblemKind::Contradiction, &setting("type"), reason);
            return None;
        }
        let bits = kind.bits();
        let at = 8 * u32::from(byte) + u32::from(bit);
        if at + u32::from(bits) > room {
            let reason = format!("the object has {room} bits with the padding behind it");
            let problem = self.check.report(ProblemKind::OutOfRange, &setting("byte"), reason);
            problem.value = Some(byte.to_string());
            let last = room.checked_sub(u32::from(bits)).map(|last| last / 8);
            problem.limit = last.map(|last| format!("0 to {last}"));
            return None;
        }
        Some((at, bits, kind))
    }

    fn beyond(&mut self, setting: &str, reason: &str, value: u8, most: u8) {
        let problem = self.check.report(ProblemKind::OutOfRange, setting, reason);
        problem.value = Some(value.to_string());
        problem.limit = Some(format!("0 to {most}"));
    }

    /// Two that are written to the same bits would each undo the other.
    pub(super) fn own_bits_each(&mut self, output: &[OutputPlan]) {
        let bits = |one: &OutputPlan| one.coding.map(|coding| coding.bit_range());
        for (n, one) in output.iter().enumerate() {
            let Some(own) = bits(one) else { continue };
            let before = output[..n].iter().find(|other| {
                bits(other).is_some_and(|other| other.start < own.end && own.start < other.end)
            });
            if let Some(other) = before {
                let setting = self.setting(&format!("output[{n}].object"));
                let reason = format!("it stands in bits of `{}`, which would be lost", other.name);
                self.check.report(ProblemKind::Contradiction, &setting, reason).value =
                    Some(format!("\"{}\"", one.name));
            }
        }
    }

    /// Recordings have a column for each, and one for the age.
    pub(super) fn one_name_each(&mut self, input: &[InputPlan], output: &[OutputPlan]) {
        let inputs = input.iter().map(|one| ("input", &one.name, &one.unit));
        let outputs = output.iter().map(|one| ("output", &one.name, &one.unit));
        let mut seen = vec!["age".to_owned(), column_name("age", "s")];
        for (n, (key, name, unit)) in inputs.chain(outputs).enumerate() {
            let column = column_name(name, unit);
            if seen.contains(name) || seen.contains(&column) {
                let place = if key == "input" { n } else { n - input.len() };
                let setting = self.setting(&format!("{key}[{place}].name"));
                let reason =
                    "another signal of this SubDevice, or its age, is called so, or so with its unit";
                self.check.report(ProblemKind::Duplicate, &setting, reason).value =
                    Some(format!("\"{name}\""));
            }
            seen.extend([name.clone(), column]);
        }
    }
}

/// A signal as written, whichever way it goes.
struct Written<'a> {
    name: &'a Option<String>,
    object: &'a Option<String>,
    byte: Option<u8>,
    bit: Option<u8>,
    kind: Option<SignalType>,
    unit: &'a Option<String>,
    scale: Option<f64>,
    offset: Option<f64>,
}

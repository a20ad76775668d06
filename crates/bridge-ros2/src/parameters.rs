//! The robot's live settings as parameters, with the robot's own refusals.

use std::collections::BTreeMap;
use std::time::Instant;

use omnibase_client::{Answer, Seat};
use ros2_client::parameters::raw::{
    FloatingPointRange, Parameter, ParameterDescriptor, ParameterEvent, ParameterType, ParameterValue,
    SetParametersResult,
};
use ros2_client::rcl_interfaces::{
    DescribeParametersRequest, DescribeParametersResponse, GetParameterTypesRequest,
    GetParameterTypesResponse, GetParametersRequest, GetParametersResponse, ListParametersRequest,
    ListParametersResponse, ListParametersResult, SetParametersAtomicallyResponse, SetParametersRequest,
    SetParametersResponse,
};
use ros2_client::{Publisher, RmwRequestId, Server};
use serde_json::{Map, Value, json};

use crate::node::Ros;

/// The one parameter that is the bridge's own: the path that `load` takes and `teach` keeps.
const PATH_NAME: &str = "path_name";

/// A setting: its value, and the least and the greatest that is allowed.
#[derive(Clone, Debug, PartialEq)]
struct Setting {
    value: f64,
    range: [f64; 2],
}

/// Parameters that were asked for together.
struct Batch {
    id: RmwRequestId,
    is_atomic: bool,
    results: Vec<Option<SetParametersResult>>,
}

/// All parameters.
pub struct Parameters {
    get: Server<GetParametersRequest, GetParametersResponse>,
    types: Server<GetParameterTypesRequest, GetParameterTypesResponse>,
    list: Server<ListParametersRequest, ListParametersResponse>,
    describe: Server<DescribeParametersRequest, DescribeParametersResponse>,
    set: Server<SetParametersRequest, SetParametersResponse>,
    set_atomically: Server<SetParametersRequest, SetParametersAtomicallyResponse>,
    events: Publisher<ParameterEvent>,
    node: String,
    settings: BTreeMap<String, Setting>,
    path_name: String,
    batches: BTreeMap<u64, Batch>,
    /// For an answer's number: which batch, and which of its parameters.
    waiting: BTreeMap<u64, (u64, usize)>,
    next: u64,
}

fn nothing() -> ParameterValue {
    ParameterValue {
        ptype: ParameterType::NOT_SET,
        boolean_value: false,
        int_value: 0,
        double_value: 0.0,
        string_value: String::new(),
        byte_array: vec![],
        bool_array: vec![],
        int_array: vec![],
        double_array: vec![],
        string_array: vec![],
    }
}

fn double(value: f64) -> ParameterValue {
    ParameterValue { ptype: ParameterType::DOUBLE, double_value: value, ..nothing() }
}

fn text(value: &str) -> ParameterValue {
    ParameterValue { ptype: ParameterType::STRING, string_value: value.to_owned(), ..nothing() }
}

fn refused(reason: impl Into<String>) -> SetParametersResult {
    SetParametersResult { successful: false, reason: reason.into() }
}

impl Parameters {
    /// Serves them below the node's name.
    pub fn new(ros: &mut Ros) -> anyhow::Result<Parameters> {
        macro_rules! server {
            ($name:literal, $kind:literal) => {
                ros.own_server($name, concat!("rcl_interfaces/srv/", $kind))?
            };
        }
        Ok(Parameters {
            get: server!("get_parameters", "GetParameters"),
            types: server!("get_parameter_types", "GetParameterTypes"),
            list: server!("list_parameters", "ListParameters"),
            describe: server!("describe_parameters", "DescribeParameters"),
            set: server!("set_parameters", "SetParameters"),
            set_atomically: server!("set_parameters_atomically", "SetParametersAtomically"),
            events: ros.parameter_events()?,
            node: ros.full_name(),
            settings: BTreeMap::new(),
            path_name: "ros2".to_owned(),
            batches: BTreeMap::new(),
            waiting: BTreeMap::new(),
            next: 0,
        })
    }

    /// The path that is loaded or taught.
    pub fn path_name(&self) -> &str {
        &self.path_name
    }

    /// What the robot says of its settings; who listens is told of changes, whoever made them.
    pub fn told(&mut self, settings: &Value) {
        let mut changed = Vec::new();
        for setting in settings.as_array().into_iter().flatten() {
            let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
            let Some(name) = setting["name"].as_str() else { continue };
            let range = [number(&setting["range"][0]), number(&setting["range"][1])];
            let new = Setting { value: number(&setting["value"]), range };
            match self.settings.insert(name.to_owned(), new.clone()) {
                Some(old) if old.value.to_bits() == new.value.to_bits() => {}
                _ => changed.push(Parameter { name: name.to_owned(), value: double(new.value) }),
            }
        }
        self.tell_changes(changed);
    }

    fn tell_changes(&self, changed_parameters: Vec<Parameter>) {
        if changed_parameters.is_empty() {
            return;
        }
        let stamp = ros2_client::builtin_interfaces::Time::now();
        let (new_parameters, deleted_parameters) = (vec![], vec![]);
        let node = self.node.clone();
        let event = ParameterEvent { stamp, node, new_parameters, changed_parameters, deleted_parameters };
        // Nobody may listen.
        let _ = self.events.publish(event);
    }

    fn value(&self, name: &str) -> ParameterValue {
        match self.settings.get(name) {
            _ if name == PATH_NAME => text(&self.path_name),
            Some(setting) => double(setting.value),
            None => nothing(),
        }
    }

    fn names(&self) -> impl Iterator<Item = &str> {
        self.settings.keys().map(String::as_str).chain([PATH_NAME])
    }

    fn described(&self, name: &str) -> ParameterDescriptor {
        let setting = self.settings.get(name);
        let range = setting.map(|setting| FloatingPointRange {
            from_value: setting.range[0],
            to_value: setting.range[1],
            step: 0.0,
        });
        let description = match name {
            PATH_NAME => "The path that `load` takes and `teach` keeps.",
            _ if setting.is_some() => "A live setting of the robot.",
            _ => "",
        };
        ParameterDescriptor {
            name: name.to_owned(),
            r#type: self.value(name).ptype,
            description: description.to_owned(),
            additional_constraints: String::new(),
            read_only: false,
            dynamic_typing: false,
            floating_point_range: range.into_iter().collect(),
            integer_range: vec![],
        }
    }

    /// Takes what is asked now.
    pub fn take(&mut self, seat: &mut Seat) -> Result<(), omnibase_client::Error> {
        // Whoever asked may be gone.
        while let Ok(Some((id, GetParametersRequest { names }))) = self.get.receive_request() {
            let values = names.iter().map(|name| self.value(name)).collect();
            let _ = self.get.send_response(id, GetParametersResponse { values });
        }
        while let Ok(Some((id, GetParameterTypesRequest { names }))) = self.types.receive_request() {
            let values = names.iter().map(|name| self.value(name).ptype).collect();
            let _ = self.types.send_response(id, GetParameterTypesResponse { values });
        }
        while let Ok(Some((id, ListParametersRequest { prefixes, .. }))) = self.list.receive_request() {
            let begins = |name: &str, prefix: &String| {
                name.strip_prefix(prefix.as_str())
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            };
            let is_asked =
                |name: &&str| prefixes.is_empty() || prefixes.iter().any(|prefix| begins(name, prefix));
            let names: Vec<String> = self.names().filter(is_asked).map(str::to_owned).collect();
            let folders = names.iter().filter_map(|name| Some(name.rsplit_once('.')?.0.to_owned()));
            let prefixes = folders.collect::<std::collections::BTreeSet<_>>().into_iter().collect();
            let result = ListParametersResult { names, prefixes };
            let _ = self.list.send_response(id, ListParametersResponse { result });
        }
        while let Ok(Some((id, DescribeParametersRequest { names }))) = self.describe.receive_request() {
            let values = names.iter().map(|name| self.described(name)).collect();
            let _ = self.describe.send_response(id, DescribeParametersResponse { values });
        }
        while let Ok(Some((id, SetParametersRequest { parameter }))) = self.set.receive_request() {
            self.ask(seat, id, &parameter, false)?;
        }
        while let Ok(Some((id, SetParametersRequest { parameter }))) = self.set_atomically.receive_request() {
            self.ask(seat, id, &parameter, true)?;
        }
        Ok(())
    }

    /// A setting's new value, where it can be one.
    fn new_value(&self, Parameter { name, value }: &Parameter) -> Result<f64, String> {
        if !self.settings.contains_key(name) {
            return Err(format!("the robot has no setting `{name}`"));
        }
        match value.ptype {
            ParameterType::DOUBLE => Ok(value.double_value),
            // As a person writes 2.0.
            ParameterType::INTEGER => Ok(value.int_value as f64),
            found => Err(format!("{name}: expected a double, found a parameter of type {found}")),
        }
    }

    fn ask(
        &mut self,
        seat: &mut Seat,
        id: RmwRequestId,
        parameters: &[Parameter],
        is_atomic: bool,
    ) -> Result<(), omnibase_client::Error> {
        let batch = self.next;
        self.next += 1;
        let mut results = vec![None; parameters.len()];
        if is_atomic {
            let values: Result<Map<String, Value>, String> = parameters
                .iter()
                .map(|parameter| Ok((parameter.name.clone(), json!(self.new_value(parameter)?))))
                .collect();
            results = vec![None];
            match values {
                Ok(values) if values.is_empty() => {
                    results[0] = Some(SetParametersResult { successful: true, reason: String::new() });
                }
                Ok(values) => {
                    let number = seat.ask(json!({ "do": "set", "values": values }), Instant::now())?;
                    self.waiting.insert(number, (batch, 0));
                }
                Err(words) => results[0] = Some(refused(words)),
            }
        } else {
            for (at, parameter) in parameters.iter().enumerate() {
                match self.new_value(parameter) {
                    Ok(value) => {
                        let values = json!({ parameter.name.clone(): value });
                        let number = seat.ask(json!({ "do": "set", "values": values }), Instant::now())?;
                        self.waiting.insert(number, (batch, at));
                    }
                    Err(words) => results[at] = Some(self.own(parameter).unwrap_or_else(|| refused(words))),
                }
            }
        }
        self.batches.insert(batch, Batch { id, is_atomic, results });
        self.finish(batch);
        Ok(())
    }

    /// Sets what is the bridge's own.
    fn own(&mut self, Parameter { name, value }: &Parameter) -> Option<SetParametersResult> {
        if name != PATH_NAME {
            return None;
        }
        if value.ptype != ParameterType::STRING {
            return Some(refused("path_name: expected a string"));
        }
        self.path_name.clone_from(&value.string_value);
        self.tell_changes(vec![Parameter { name: name.clone(), value: value.clone() }]);
        Some(SetParametersResult { successful: true, reason: String::new() })
    }

    /// Hands an answer to who waits for it; whether somebody did.
    pub fn answer(&mut self, answer: &Answer) -> bool {
        let Some((batch, at)) = self.waiting.remove(&answer.number) else { return false };
        if let Some(batch) = self.batches.get_mut(&batch) {
            let reason = if answer.done { String::new() } else { answer.text.clone() };
            batch.results[at] = Some(SetParametersResult { successful: answer.done, reason });
        }
        self.finish(batch);
        true
    }

    /// Tells who asked, where all is known.
    fn finish(&mut self, batch: u64) {
        let is_whole = |batch: &Batch| batch.results.iter().all(Option::is_some);
        if !self.batches.get(&batch).is_some_and(is_whole) {
            return;
        }
        let Some(Batch { id, is_atomic, results }) = self.batches.remove(&batch) else { return };
        let mut results: Vec<SetParametersResult> = results.into_iter().flatten().collect();
        // Whoever asked may be gone.
        let _ = match (is_atomic, results.pop()) {
            (true, Some(result)) => {
                self.set_atomically.send_response(id, SetParametersAtomicallyResponse { result })
            }
            (_, last) => {
                results.extend(last);
                self.set.send_response(id, SetParametersResponse { results })
            }
        };
    }
}

//! Keys that a kind declares as its own.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::problem::Problem;

/// The table `custom`: the keys that a registered kind declares as its own.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct Parameters(pub serde_json::Map<String, serde_json::Value>);

impl Parameters {
    /// A number; of one that is needed and declared as such the check made sure.
    pub fn number(&self, key: &str) -> Result<f64, Box<Problem>> {
        let value = self.0.get(key).and_then(serde_json::Value::as_f64);
        value.ok_or_else(|| Box::new(Problem::missing(format!("custom.{key}"), "a number")))
    }

    /// Several numbers, as [`Parameters::number`].
    pub fn numbers<const N: usize>(&self, keys: [&str; N]) -> Result<[f64; N], Box<Problem>> {
        let mut numbers = [0.0; N];
        for (number, key) in numbers.iter_mut().zip(keys) {
            *number = self.number(key)?;
        }
        Ok(numbers)
    }
}

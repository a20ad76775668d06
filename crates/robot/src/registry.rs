//! Stages by name: the built-in ones, and those that users register from their own crates.

use crate::config::{DrivePlan, Identity, ParameterPlan, PdoPlan, RobotPlan};
use crate::stages::{Controller, Device, Estimator, Reference};

/// Why a stage couldn't be made from a plan.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StageError {
    /// Nothing is registered by this name.
    #[error("{stage} `{name}`: nothing is registered by this name")]
    Unknown {
        /// Sort of stage.
        stage: &'static str,
        /// The name.
        name: String,
    },
    /// The stage refused its settings.
    #[error("{setting}: {reason}")]
    Refused {
        /// The setting by its full name.
        setting: String,
        /// Why, with value and limit.
        reason: String,
    },
}

/// What a device brings along where the robot's file says nothing.
#[derive(Clone, Debug, Default)]
pub struct DeviceDefaults {
    /// Who must be there.
    pub identity: Identity,
    /// PDOs from the cycle to the drive.
    pub outputs: Vec<PdoPlan>,
    /// PDOs from the drive to the cycle.
    pub inputs: Vec<PdoPlan>,
    /// Encoder counts per revolution.
    pub counts_per_revolution: Option<u32>,
    /// Parameters that every drive of this kind is sent first.
    pub parameters: Vec<ParameterPlan>,
}

type Make<Plan, Stage> = Box<dyn Fn(&Plan) -> Result<Box<Stage>, StageError> + Send + Sync>;

struct Named<Plan, Stage: ?Sized> {
    name: &'static str,
    make: Make<Plan, Stage>,
}

/// Stages by name.
pub struct Registry {
    devices: Vec<(DeviceDefaults, Named<DrivePlan, dyn Device>)>,
    estimators: Vec<Named<RobotPlan, dyn Estimator>>,
    references: Vec<Named<RobotPlan, dyn Reference>>,
    controllers: Vec<Named<RobotPlan, dyn Controller>>,
}

impl Registry {
    /// A registry without any stage.
    pub fn empty() -> Self {
        Registry {
            devices: Vec::new(),
            estimators: Vec::new(),
            references: Vec::new(),
            controllers: Vec::new(),
        }
    }

    /// A registry with the built-in stages.
    pub fn with_built_in() -> Self {
        let mut registry = Registry::empty();
        crate::devices::register(&mut registry);
        crate::estimators::register(&mut registry);
        crate::references::register(&mut registry);
        crate::controllers::register(&mut registry);
        registry
    }

    /// Registers a device; one of the same name is replaced.
    pub fn device(
        &mut self,
        name: &'static str,
        defaults: DeviceDefaults,
        make: impl Fn(&DrivePlan) -> Result<Box<dyn Device>, StageError> + Send + Sync + 'static,
    ) -> &mut Self {
        self.devices.retain(|(_, device)| device.name != name);
        self.devices.push((defaults, Named { name, make: Box::new(make) }));
        self
    }

    /// Registers an estimator; one of the same name is replaced.
    pub fn estimator(
        &mut self,
        name: &'static str,
        make: impl Fn(&RobotPlan) -> Result<Box<dyn Estimator>, StageError> + Send + Sync + 'static,
    ) -> &mut Self {
        put(&mut self.estimators, name, Box::new(make));
        self
    }

    /// Registers a reference; one of the same name is replaced.
    pub fn reference(
        &mut self,
        name: &'static str,
        make: impl Fn(&RobotPlan) -> Result<Box<dyn Reference>, StageError> + Send + Sync + 'static,
    ) -> &mut Self {
        put(&mut self.references, name, Box::new(make));
        self
    }

    /// Registers a controller; one of the same name is replaced.
    pub fn controller(
        &mut self,
        name: &'static str,
        make: impl Fn(&RobotPlan) -> Result<Box<dyn Controller>, StageError> + Send + Sync + 'static,
    ) -> &mut Self {
        put(&mut self.controllers, name, Box::new(make));
        self
    }

    /// Names of the devices.
    pub fn devices(&self) -> Vec<&str> {
        self.devices.iter().map(|(_, device)| device.name).collect()
    }

    /// Names of the estimators.
    pub fn estimators(&self) -> Vec<&str> {
        self.estimators.iter().map(|named| named.name).collect()
    }

    /// Names of the references.
    pub fn references(&self) -> Vec<&str> {
        self.references.iter().map(|named| named.name).collect()
    }

    /// Names of the controllers.
    pub fn controllers(&self) -> Vec<&str> {
        self.controllers.iter().map(|named| named.name).collect()
    }

    /// What a device brings along; `None` where none has this name.
    pub fn device_defaults(&self, name: &str) -> Option<&DeviceDefaults> {
        self.devices.iter().find(|(_, device)| device.name == name).map(|(defaults, _)| defaults)
    }

    /// Makes the device of a drive.
    pub fn make_device(&self, plan: &DrivePlan) -> Result<Box<dyn Device>, StageError> {
        let found = self.devices.iter().find(|(_, device)| device.name == plan.device);
        let (_, device) =
            found.ok_or_else(|| StageError::Unknown { stage: "device", name: plan.device.clone() })?;
        (device.make)(plan)
    }

    /// Makes the estimator of a plan.
    pub fn make_estimator(&self, plan: &RobotPlan) -> Result<Box<dyn Estimator>, StageError> {
        make(&self.estimators, "estimator", plan.estimator.kind.as_deref().unwrap_or("wheel_odometry"), plan)
    }

    /// Makes the reference of a plan.
    pub fn make_reference(&self, plan: &RobotPlan) -> Result<Box<dyn Reference>, StageError> {
        make(&self.references, "reference", plan.reference.kind.as_deref().unwrap_or("hold"), plan)
    }

    /// Makes the controllers of a plan: the one that begins, then those to which it can be switched.
    pub fn make_controllers(&self, plan: &RobotPlan) -> Result<Vec<Box<dyn Controller>>, StageError> {
        plan.controllers().map(|name| make(&self.controllers, "controller", name, plan)).collect()
    }
}

fn put<Stage: ?Sized>(
    list: &mut Vec<Named<RobotPlan, Stage>>,
    name: &'static str,
    make: Make<RobotPlan, Stage>,
) {
    list.retain(|named| named.name != name);
    list.push(Named { name, make });
}

fn make<Stage: ?Sized>(
    list: &[Named<RobotPlan, Stage>],
    stage: &'static str,
    name: &str,
    plan: &RobotPlan,
) -> Result<Box<Stage>, StageError> {
    let named = list.iter().find(|named| named.name == name);
    let named = named.ok_or_else(|| StageError::Unknown { stage, name: name.into() })?;
    (named.make)(plan)
}

//! The bridge's node in ROS 2's graph.

use std::net::Ipv4Addr;

use anyhow::Context as _;
use ros2_client::action::{ActionServer, ActionServerQosPolicies};
use ros2_client::parameters::raw::ParameterEvent;
use ros2_client::qos::{Durability, History, QosProfile, Reliability, WhenFull};
use ros2_client::rosout::RosoutRaw;
use ros2_client::{ActionTypeName, Message, ServiceMapping, ServiceTypeName, log::LogLevel};
use ros2_client::{
    Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, Server, Subscription,
};
use rustdds::{DomainParticipant, DomainParticipantBuilder};
use serde::Serialize;

use crate::arguments::Arguments;
use crate::messages::Defined;

/// So many messages are kept for who asks for them again, as the standard controllers do.
const DEPTH: usize = 10;

/// A topic that tells what counts now.
pub fn telling() -> QosProfile {
    QosProfile::publisher_default()
        // Whoever takes nothing holds nobody up.
        .reliability(Reliability::Reliable { when_full: WhenFull::Fail })
        .history(History::KeepLast { depth: DEPTH })
}

/// A topic that tells so often that ten messages are a moment: those of a second are kept.
pub fn telling_at(hz: f64) -> QosProfile {
    telling().history(History::KeepLast { depth: DEPTH.max(hz.ceil() as usize) })
}

/// A topic whose last message is for those who come later too.
pub fn latched() -> QosProfile {
    telling().durability(Durability::TransientLocal).history(History::KeepLast { depth: 1 })
}

/// A topic of which the newest counts: it hears those who tell reliably and those who don't.
pub fn newest() -> QosProfile {
    QosProfile::subscription_default()
}

/// A topic of which nothing shall be lost.
pub fn reliable() -> QosProfile {
    telling()
}

/// A service's two topics.
pub fn service() -> QosProfile {
    QosProfile::publisher_default().history(History::KeepLast { depth: DEPTH })
}

/// A node, and the participant behind it.
pub struct Ros {
    node: Node,
    context: Context,
    participant: DomainParticipant,
    name: NodeName,
}

/// Whether this computer alone is to be seen, as ROS 2's own programs are told.
fn is_for_here_alone() -> bool {
    let is =
        |name: &str, value: &str| std::env::var(name).is_ok_and(|found| found.eq_ignore_ascii_case(value));
    is("ROS_LOCALHOST_ONLY", "1") || is("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
}

impl Ros {
    /// Joins the graph.
    pub fn join(arguments: &Arguments) -> anyhow::Result<Ros> {
        let name = NodeName::new(&arguments.namespace, &arguments.name)
            .map_err(|error| anyhow::anyhow!("--namespace or --name: {error:?}"))?;
        let mut builder = DomainParticipantBuilder::new(arguments.domain()?);
        if is_for_here_alone() {
            builder = builder.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let participant = builder.build().context("joining the DDS domain")?;
        let context = Context::from_domain_participant(participant.clone())
            .map_err(|error| anyhow::anyhow!("joining ROS 2: {error:?}"))?;
        let options = NodeOptions::new().start_parameter_services(false);
        let node = context
            .new_node(name.clone(), options)
            .map_err(|error| anyhow::anyhow!("making the node: {error:?}"))?;
        Ok(Ros { node, context, participant, name })
    }

    /// The participant, which knows everybody's endpoints.
    pub fn participant(&self) -> &DomainParticipant {
        &self.participant
    }

    /// A whole name: `ros2-client` would put two slashes behind a namespace that is one.
    fn named(&self, name: &str) -> anyhow::Result<Name> {
        let whole = match name.strip_prefix('/') {
            Some(_) => name.to_owned(),
            None => format!("{}/{name}", self.name.namespace().trim_end_matches('/')),
        };
        Name::parse(&whole).map_err(|error| anyhow::anyhow!("the name `{whole}`: {error:?}"))
    }

    /// A topic's name as DDS has it.
    pub fn dds_name(&self, topic: &str) -> anyhow::Result<String> {
        Ok(self.named(topic)?.to_dds_name("rt", &self.name, ""))
    }

    /// The node's own name, as /robot_1/omnibase.
    pub fn full_name(&self) -> String {
        self.node.fully_qualified_name()
    }

    /// Serves what is asked below the node's own name, as `omnibase/get_parameters`.
    pub fn own_server<Q, A>(&mut self, name: &str, kind: &str) -> anyhow::Result<Server<Q, A>>
    where
        Q: Message + Clone + 'static,
        A: Message + Clone + 'static,
    {
        self.server(&format!("{}/{name}", self.name.base_name()), kind)
    }

    /// Tells messages.
    pub fn publisher<M: Defined + Serialize>(
        &mut self,
        topic: &str,
        qos: QosProfile,
    ) -> anyhow::Result<Publisher<M>> {
        let made = self.node.create_topic(&self.named(topic)?, type_name::<M>(), &qos);
        let made = made.and_then(|topic| self.node.create_publisher(&topic, Some(qos)));
        made.map_err(|error| anyhow::anyhow!("the topic `{topic}`: {error:?}"))
    }

    /// Hears messages of a type, which `R` reads.
    pub fn subscription<M: Defined, R: 'static>(
        &mut self,
        topic: &str,
        qos: QosProfile,
    ) -> anyhow::Result<Subscription<R>> {
        let made = self.node.create_topic(&self.named(topic)?, type_name::<M>(), &qos);
        let made = made.and_then(|topic| self.node.create_subscription(&topic, Some(qos)));
        made.map_err(|error| anyhow::anyhow!("the topic `{topic}`: {error:?}"))
    }

    /// Serves what is asked.
    pub fn server<Q, A>(&mut self, service_name: &str, kind: &str) -> anyhow::Result<Server<Q, A>>
    where
        Q: Message + Clone + 'static,
        A: Message + Clone + 'static,
    {
        let (package, kind) = kind.split_once("/srv/").context("a service's type has /srv/")?;
        let kind = ServiceTypeName::new(package, kind);
        let name = self.named(service_name)?;
        let made = self.node.create_server(ServiceMapping::Enhanced, &name, &kind, service(), service());
        made.map_err(|error| anyhow::anyhow!("the service `{service_name}`: {error:?}"))
    }

    /// Serves an action.
    pub fn action_server<G, R, F>(
        &mut self,
        name: &str,
        kind: &ActionTypeName,
        qos: ActionServerQosPolicies,
    ) -> anyhow::Result<ActionServer<G, R, F>>
    where
        G: Message + Clone + 'static,
        R: Message + Clone + 'static,
        F: Message + 'static,
    {
        let whole = self.named(name)?;
        let made = self.node.create_action_server(ServiceMapping::Enhanced, &whole, kind, qos);
        made.map_err(|error| anyhow::anyhow!("the action `{name}`: {error:?}"))
    }

    /// Tells changes of parameters.
    pub fn parameter_events(&mut self) -> anyhow::Result<Publisher<ParameterEvent>> {
        let made = self.node.create_publisher(&self.context.get_parameter_events_topic(), None);
        made.map_err(|error| anyhow::anyhow!("the topic of parameters' events: {error:?}"))
    }

    /// Says something to whoever looks: here, and in the graph.
    pub fn warn(&self, text: &str) {
        eprintln!("warning: {text}");
        let now = ros2_client::builtin_interfaces::Time::now();
        let name = self.name.base_name();
        self.node.rosout_raw(now, LogLevel::Warn, name, text, file!(), "", line!());
    }
}

/// A type's name in two parts.
fn type_name<M: Defined>() -> MessageTypeName {
    let (package, name) = M::NAME.split_once("/msg/").unwrap_or(("", M::NAME));
    MessageTypeName::new(package, name)
}

//! A run that people and programs lead: its page, and where the command line finds it.

use super::joystick_thread::JoystickThread;
use super::receivers;
use crate::WrongUsage;
use crate::bridges::{Bridge, Bridges};
use crate::commands::DASHBOARD;
use crate::progress::{note, warn};
use crate::token;
use anyhow::Context;
use omnibase_client::robots::{self, Endpoint, Found, RunningRobot};
use omnibase_dashboard::{Access, Dashboard, RobotInfo, Streams};
use omnibase_receive::Receivers;
use omnibase_record::run::RunDescriber;
use omnibase_robot::Registry;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::Switch;
use omnibase_robot::signals::StopCategory;
use omnibase_run::LoadedRobot;
use omnibase_run::channels::Known;
use omnibase_run::live::{Ages, Live, LiveEnd, live};
use omnibase_run::room::Room;
use std::convert::Infallible;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The longest silence of a page that is still there, ns.
const SESSION_AGE_NS: u64 = 1_000_000_000;

/// How people reach a running robot.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    /// Serve the robot's page: watch, drive by hand, teach, start, pause, stop. Elsewhere than on loopback nobody gets
    /// in without the token.
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = DASHBOARD
    )]
    dashboard: Option<SocketAddr>,
    /// A file of mode 0600 with the secret of those who may command. Otherwise the environment variable OMNIBASE_TOKEN
    /// says it, or a new one is made for each run.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Refused: everybody would see it.
    #[arg(long, hide = true, value_parser = token::refused)]
    token: Option<Infallible>,
    /// Send every value to PlotJuggler's UDP server, as JSON, a hundred times a second.
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:9870"
    )]
    plotjuggler: Option<SocketAddr>,
    /// Serve the robot as it is drawn, its events and every value to the Foxglove app, on loopback.
    #[arg(
        long,
        value_name = "ADDRESS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "127.0.0.1:8765",
        value_parser = on_loopback
    )]
    foxglove: Option<SocketAddr>,
    /// Serve no page, whatever the robot's file says.
    #[arg(long, conflicts_with_all = ["dashboard", "token_file", "plotjuggler", "paths"])]
    no_dashboard: bool,
    /// Where taught paths are kept; default: the folder `paths`, or what the robot's file says.
    #[arg(long, value_name = "FOLDER")]
    paths: Option<PathBuf>,
    /// Drive by the joystick at this computer, as the `joystick` table of its file says: the first one that fits, a
    /// device (/dev/input/event5), or a recording of `omnibase joystick --record`.
    #[arg(long, value_name = "DEVICE", num_args = 0..=1)]
    #[expect(clippy::option_option, reason = "not wanted, wanted, wanted with a device")]
    joystick: Option<Option<PathBuf>>,
    /// Take no joystick, whatever the robot's file says.
    #[arg(long, conflicts_with = "joystick")]
    no_joystick: bool,
    /// Start no bridge, whatever the robot's file says.
    #[arg(long)]
    no_bridges: bool,
    /// What the file's tables `bridge` want.
    #[arg(skip)]
    bridges: Vec<Bridge>,
}

/// What serves people while a robot runs.
pub struct Operated {
    /// They end before what they talk to.
    _bridges: Option<Bridges>,
    _page: Option<Dashboard>,
    _joystick: Option<JoystickThread>,
    _receivers: Receivers,
}

impl Options {
    /// Takes over what the robot's file says where the command line says nothing; paths begin at the file's folder.
    pub fn fill(&mut self, plan: &RobotPlan, folder: &Path) -> anyhow::Result<()> {
        let table = &plan.run;
        if !self.no_bridges {
            self.bridges = Bridges::wanted(&plan.bridges, folder)?;
        }
        if let Some(served) = table.dashboard.as_ref().and_then(Switch::is_on)
            && self.dashboard.is_none()
            && !self.no_dashboard
        {
            self.dashboard = Some(served.unwrap_or(DASHBOARD).parse().context("[run] dashboard")?);
        }
        if let Some(joystick) = table.joystick.as_ref().and_then(Switch::is_on)
            && self.joystick.is_none()
            && !self.no_joystick
        {
            self.joystick = Some(joystick.map(|device| folder.join(device)));
        }
        let of_page = [
            ("--token-file", self.token_file.is_some()),
            ("--plotjuggler", self.plotjuggler.is_some()),
            ("--paths", self.paths.is_some()),
            ("--foxglove", self.foxglove.is_some()),
        ];
        let of_nobody = of_page.iter().find(|(_, is_given)| *is_given && self.dashboard.is_none());
        if let Some((option, _)) = of_nobody {
            return Err(
                WrongUsage(anyhow::anyhow!("{option} is for --dashboard, and no page is served")).into()
            );
        }
        let in_folder = |path: &Option<String>| path.as_ref().map(|path| folder.join(path));
        self.token_file = self.token_file.take().or_else(|| in_folder(&table.token_file));
        self.paths = self.paths.take().or_else(|| in_folder(&table.paths));
        Ok(())
    }

    /// Whether people lead the robot.
    pub fn is_wanted(&self) -> bool {
        self.dashboard.is_some() || self.joystick.is_some() || !self.bridges.is_empty()
    }

    /// Starts what is wanted. On virtual time a run that nobody leads is over before it could answer anybody.
    pub fn start(
        &self,
        robot: &LoadedRobot,
        room: Room,
        registry: Arc<Registry>,
        known: Known,
        describer: Option<RunDescriber>,
    ) -> anyhow::Result<Option<(Operated, LiveEnd)>> {
        if !self.is_wanted() && known == Known::Truth {
            receivers::none_on_virtual_time(&robot.plan);
            return Ok(None);
        }
        let ages = Ages { stick_ns: robot.plan.safety.command_age_ns, session_ns: SESSION_AGE_NS };
        let (live, mut end): (Live, LiveEnd) = live(ages, StopCategory::RampThenRemove, &robot.plan.sources);
        if let Some(describer) = describer {
            live.describe_to(describer);
        }
        let joystick = match &self.joystick {
            Some(path) => Some(JoystickThread::start(path.as_deref(), &robot.plan, live.clone())?),
            None => None,
        };
        let are_received = receivers::are_wanted(&robot.plan, known);
        let receivers = receivers::start(&robot.plan, known, &live)?;
        let streams = Streams { plotjuggler: self.plotjuggler, foxglove: self.foxglove };
        let paths = self.paths.clone().unwrap_or_else(|| "paths".into());
        let about = RobotInfo { room, robot: robot.clone(), registry, known, paths, streams };
        let page = match self.dashboard {
            Some(address) => Some(self.serve(address, live, about)?),
            None => match serve_owner(live, about) {
                Ok(page) => Some(page),
                Err(error) if !self.bridges.is_empty() => {
                    return Err(error.context("a place for the bridges"));
                }
                Err(error) => {
                    warn(format_args!("`omnibase get` won't reach this robot: {error:#}"));
                    None
                }
            },
        };
        if !self.is_wanted() {
            if page.is_none() && !are_received {
                return Ok(None);
            }
            end.stand_beside_plan();
        }
        let (page, found) = page.unzip();
        let bridges = match found {
            Some(found) if !self.bridges.is_empty() => Some(Bridges::start(self.bridges.clone(), &found)?),
            _ => None,
        };
        let (_page, _joystick, _receivers) = (page, joystick, receivers);
        Ok(Some((Operated { _bridges: bridges, _page, _joystick, _receivers }, end)))
    }

    fn serve(&self, address: SocketAddr, live: Live, about: RobotInfo) -> anyhow::Result<(Dashboard, Found)> {
        let mut access = Access::new(address).context("making a token")?;
        if let Some(token) = token::given(self.token_file.as_deref())? {
            access.token = token;
        }
        let name = about.robot.plan.name.clone();
        let dashboard = Dashboard::start(access.clone(), live, about)?;
        // Before its address is told: whoever waits for that finds the robot by then.
        let announced = RunningRobot::announce(&name, Endpoint::Address(dashboard.address), &access.token);
        let unfound = announced.map(|running| dashboard.keep(running)).err();
        note(format_args!("dashboard: {}", access.url(dashboard.address)));
        if let Some(address) = dashboard.foxglove {
            note(format_args!("foxglove: ws://{address}"));
        }
        if dashboard.address.ip().is_unspecified() {
            note(format_args!(
                "from elsewhere: this machine's own address in place of {}",
                dashboard.address.ip()
            ));
        }
        if let Some(error) = unfound {
            warn(format_args!("`omnibase get` won't find this robot: {error}"));
        }
        let found =
            Found { robot: name, place: Endpoint::Address(dashboard.address), token: access.token.clone() };
        Ok((dashboard, found))
    }
}

/// Serves the commands of the robot's own user, by a socket.
fn serve_owner(live: Live, about: RobotInfo) -> anyhow::Result<(Dashboard, Found)> {
    let socket = robots::socket()?;
    let name = about.robot.plan.name.clone();
    let running = RunningRobot::announce(&name, Endpoint::Socket(socket.clone()), "")?;
    let dashboard = Dashboard::start_for_owner(&socket, live, about)?;
    dashboard.keep(running);
    Ok((dashboard, Found { robot: name, place: Endpoint::Socket(socket), token: String::new() }))
}

/// Whoever connects may read: that is for this machine alone.
fn on_loopback(text: &str) -> Result<SocketAddr, String> {
    let address: SocketAddr = text.parse().map_err(|error: std::net::AddrParseError| error.to_string())?;
    if address.ip().is_loopback() {
        return Ok(address);
    }
    Err(format!("expected an address on loopback, for Foxglove shows no token; found {}", address.ip()))
}

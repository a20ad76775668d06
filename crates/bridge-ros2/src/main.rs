//! `omnibase-bridge-ros2`: ROS 2's side of a running robot, in a process of its own.
//!
//! - [`bridge`]: the thread in which ROS 2's wishes meet the robot; [`command`]: what of `cmd_vel` may move it.
//! - [`states`]: the thread that follows the robot and tells what it does.
//! - [`messages`]: ROS 2's types. [`node`]: names and quality of service.
//! - [`watch`]: DDS's threads die without a word; then this process ends, and whoever supervises it starts it anew.
#![forbid(unsafe_code)]

mod actions;
mod arguments;
mod bridge;
mod clock;
mod command;
mod course;
mod diagnostics;
mod loud;
mod messages;
mod news;
mod node;
mod parameters;
mod poses;
mod robot;
mod services;
mod states;
mod watch;

use std::process::ExitCode;
use std::sync::mpsc::channel;

use anyhow::Context as _;
use arguments::Arguments;
use bridge::Bridge;
use clap::Parser as _;
use clock::{Clock, Kind};
use node::Ros;
use omnibase_client::Seat;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    // A thread that died is a bridge that lies.
    let told = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        told(panic);
        std::process::exit(1);
    }));
    let found = robot::meant(arguments)?;
    let facts = robot::Facts::of(&found)?;
    anyhow::ensure!(
        facts.simulated || !arguments.sim_time,
        "--sim-time is for a simulated robot, and this one is real"
    );
    let mut seat = Seat::take(&found)?;
    seat.recover()?;
    let clock = Clock::new(if arguments.sim_time { Kind::Robot } else { Kind::System });
    let mut ros = Ros::join(arguments)?;
    let commands = command::Commands::new(&mut ros, arguments)?;
    let wheels = facts.wheels.iter().map(|wheel| wheel.name.clone()).collect();
    let teller = states::Teller::new(&mut ros, &found, wheels, arguments, clock.clone())?;
    let news = news::News::new(&mut ros, found.clone(), &facts, arguments, teller.counts())?;
    let services = services::Services::new(&mut ros, arguments.odom_frame())?;
    let parameters = parameters::Parameters::new(&mut ros)?;
    let actions = actions::Actions::new(&mut ros, arguments.odom_frame(), facts.limits.clone())?;
    let poses = poses::PosesIn::new(&mut ros, &found, arguments)?;
    let (tell_end, ended) = channel();
    std::thread::Builder::new()
        .name("states".to_owned())
        .spawn(move || tell_end.send(teller.tell()))
        .context("starting a thread")?;
    eprintln!("{} at {} is {} in ROS 2's graph", facts.name, found.place, ros.full_name());
    Bridge {
        ros,
        seat,
        commands,
        clock,
        news,
        services,
        parameters,
        actions,
        columns: facts.columns,
        poses,
        ended,
    }
    .work()
}

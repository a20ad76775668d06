//! The program as a user runs it. One executable for all: most of these tests wait, for robots, pages and other programs, and wait
//! beside each other, and the program is linked for them once. A part alone: `cargo test -p omnibase --test program dashboard::`.

mod announced;
mod bridge;
mod calibrate;
mod circles;
mod command_line;
mod commands;
mod dashboard;
mod decode_against_tshark;
mod deployment;
mod docs;
mod doctor;
mod export;
mod joystick;
mod joystick_recording;
mod learn;
mod margins;
mod python_packages;
mod python_tools;
mod real_time;
mod recording;
mod report;
mod robot_commands;
mod segment_commands;
mod setup_page;
mod setup_terminal;
mod viewers;

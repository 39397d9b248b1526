//! The command line as a definition: no clash of names, what is accepted and what is not.

use super::*;
use clap::CommandFactory;

fn parse(line: &str) -> Result<Cli, clap::Error> {
    Cli::try_parse_from(line.split(' '))
}

/// Release builds leave out clap's own checks, so the ones that matter are made here.
#[test]
fn no_option_has_two_meanings() {
    fn check(command: &clap::Command, path: &str) {
        let path = format!("{path} {}", command.get_name());
        let arguments: Vec<_> = command.get_arguments().collect();
        for (n, a) in arguments.iter().enumerate() {
            for b in &arguments[..n] {
                assert_ne!(a.get_id(), b.get_id(), "{path}");
                assert!(a.get_long().is_none() || a.get_long() != b.get_long(), "{path}: --{}", a.get_long().unwrap_or_default());
                assert!(a.get_short().is_none() || a.get_short() != b.get_short(), "{path}: {}", a.get_id());
            }
        }
        command.get_subcommands().for_each(|inner| check(inner, &path));
    }
    let mut command = Cli::command();
    command.build();
    check(&command, "");
}

#[test]
fn chart_takes_a_verb_or_a_surface() {
    let chart = |line: &str| match parse(line).map(|cli| cli.command) {
        Ok(Command::Chart(args)) => Ok(args),
        Ok(_) => panic!("{line}"),
        Err(error) => Err(error.kind()),
    };
    let set = chart("remesh chart set abc 3 --method lscm --pin 4:0,0 --pin 9:1,0.5 --holes plane").expect("valid");
    let Some(ChartVerb::Set(PatchSpecArgs { patch: Some(3), spec, .. })) = set.verb else { panic!("{set:?}") };
    assert_eq!((spec.pins.len(), spec.holes), (2, Some(HoleChoice::Plane)));
    let all = chart("remesh chart a.stl --patches 2 --patch 1 --method harmonic --boundary square --corner 1,2,3,4").expect("valid");
    assert!(all.verb.is_none() && all.all.target.as_deref() == Some("a.stl") && all.all.spec.corners == [1, 2, 3, 4]);
    assert!(chart("remesh chart sessions/a1 --patch 0").is_ok_and(|c| c.all.only == [0]));
    for bad in [
        "remesh chart",
        "remesh chart show abc",
        "remesh chart preview abc",
        "remesh chart set abc 3 --pin 4 --pins farthest",
        "remesh chart set abc 3 --corner 4",
        "remesh chart a.stl --obj x.obj -o y",
        "remesh chart set abc 3 --method conformal",
    ] {
        assert!(chart(bad).is_err(), "{bad}");
    }
}

#[test]
fn run_takes_all_its_options() {
    let line = "remesh run in.stl -o out.msh --min-size 0.1 --max-size 2 --growth-rate 1.2 --feature-angle none --unit mm \
                    --only-region inlet --only-region 7 --patches 12 --chart mean-value --rounds 0 --fit vertices --quality --before-after a.png \
                    --encoding msh22 --threads 2 --json";
    let cli = parse(&line.split_whitespace().collect::<Vec<_>>().join(" ")).expect("valid");
    assert!(cli.global.json && cli.global.threads == Some(2));
    let Command::Run(run) = cli.command else { panic!("run expected") };
    assert_eq!(run.inputs.feature_angle, Some(FeatureAngle::None));
    assert_eq!((run.size.min_size, run.size.growth_rate, run.size.size), (Some(0.1), Some(1.2), None));
    assert_eq!(run.import.only_region, ["inlet", "7"]);
    assert_eq!((run.method.chart, run.inputs.rounds), (Some(ChartMethod::MeanValue), Some(0)));
}

#[test]
fn values_out_of_range_are_usage_errors() {
    for bad in [
        "remesh run a.stl -o b.stl --size 0",
        "remesh run a.stl -o b.stl --size nan",
        "remesh run a.stl -o b.stl --triangles 0",
        "remesh run a.stl -o b.stl --feature-angle 180",
        "remesh run a.stl --size 1",
        "remesh run a.stl -o b.stl --size 1 --partition-strategy best",
        "remesh run a.stl -o b.stl --size 1 --partition-strategy plane --plane 0,0,0,0,0,0",
        "remesh run a.stl -o b.stl --size 1 --partition-strategy plane --plane 0,0,1",
        "remesh run a.stl -o b.stl --size 1 --partition-strategy plane --plane 0,0,0,0,nan,1",
        "remesh run a.stl -o b.stl --size 1 --borders straight",
        "remesh run a.stl -o b.stl --size 1 --threads 0",
        "remesh quality a.stl",
        "remesh quality",
        "remesh sample artery --triangles 5 --resolution 5 -o a.stl",
        "remesh sample cow -o a.stl",
        "remesh session set-ttl x 5y",
        "remesh plan a/b",
        "remesh render a.stl -o a.png --chart 1 --histogram",
    ] {
        assert!(parse(bad).is_err(), "{bad}");
    }
}

#[test]
fn quality_takes_files_or_a_session() {
    assert!(parse("remesh quality a.stl b.stl --size 1").is_ok());
    assert!(parse("remesh quality --session s").is_ok());
    assert!(parse("remesh quality --session s a.stl b.stl").is_err());
    assert!(parse("remesh diagnose --session s").is_ok());
    assert!(parse("remesh diagnose").is_err());
}

//! Stage records put into the groups a person thinks in.

use crate::v1;
use std::collections::BTreeSet;

/// Several stages together.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Group {
    /// What a person calls them.
    pub(crate) name: String,
    /// Sum of the times of what ran.
    pub(crate) milliseconds: f64,
    /// Outputs found in the cache.
    pub(crate) hits: u64,
    /// Outputs computed.
    pub(crate) runs: u64,
}

/// The group of a stage; a stage this client does not know is a group of its own.
fn group_name(stage: &str) -> &str {
    match stage {
        "topology" | "search_tree" | "features" | "partition" | "cut" | "patches" => "partition",
        "system" | "factor" | "boundary" | "solve" | "chart" => "charts",
        "curvature" | "proximity" | "thickness" | "centerline" | "size" | "metric" | "curve" | "planar" | "lift" => "meshing",
        "assembly" | "optimize" | "quads" => "optimisation",
        other => other,
    }
}

/// Groups in the order in which they first occur.
pub(crate) fn groups<'a>(records: impl IntoIterator<Item = &'a v1::StageRecord>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for record in records {
        let name = group_name(&record.stage);
        let index = groups.iter().position(|group| group.name == name).unwrap_or_else(|| {
            groups.push(Group { name: name.to_owned(), milliseconds: 0.0, hits: 0, runs: 0 });
            groups.len() - 1
        });
        let group = &mut groups[index];
        if record.outcome() == v1::StageOutcome::Hit {
            group.hits += 1;
        } else {
            group.runs += 1;
            group.milliseconds += record.milliseconds;
        }
    }
    groups
}

/// The records of several calls in their order, without the hits on what an earlier one of them has told: what a call computed is in
/// the cache for the next, which would only hide what was really found.
pub(crate) fn joined<'a>(summaries: &[&'a v1::RunSummary]) -> Vec<&'a v1::StageRecord> {
    let mut seen = BTreeSet::new();
    let records = summaries.iter().flat_map(|summary| &summary.stages);
    let is_new = |record: &&'a v1::StageRecord| {
        let first = seen.insert((record.stage.as_str(), record.subject.as_str()));
        first || record.outcome() == v1::StageOutcome::Run
    };
    records.filter(is_new).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(stage: &str, subject: &str, outcome: v1::StageOutcome) -> v1::StageRecord {
        v1::StageRecord { stage: stage.into(), subject: subject.into(), outcome: outcome.into(), milliseconds: 10.0, bytes: 0 }
    }

    #[test]
    fn stages_are_grouped_and_hits_cost_nothing() {
        use v1::StageOutcome::{Hit, Run};
        let first = v1::RunSummary { stages: vec![record("import", "", Run)], ..Default::default() };
        let second = v1::RunSummary {
            stages: vec![
                record("import", "", Hit),
                record("topology", "", Run),
                record("partition", "", Hit),
                record("chart", "patch 0", Hit),
                record("chart", "patch 1", Run),
                record("novelty", "", Run),
            ],
            ..Default::default()
        };
        let third = v1::RunSummary { stages: vec![record("novelty", "", Run), record("chart", "patch 1", Hit)], ..Default::default() };
        let groups = groups(joined(&[&first, &second, &third]));
        let brief: Vec<_> = groups.iter().map(|g| (g.name.as_str(), g.milliseconds, g.hits, g.runs)).collect();
        assert_eq!(brief, [("import", 10.0, 0, 1), ("partition", 10.0, 1, 1), ("charts", 10.0, 1, 1), ("novelty", 20.0, 0, 2)]);
    }
}

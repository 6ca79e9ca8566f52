//! A chart as comma-separated values (RFC 4180).

use super::answer::front_of;
use super::data::{Chart, Spread};
use crate::metrics::SeedErrors;
use std::collections::BTreeSet;

/// A line of names, then one for each point: what it is, what it took, also by a general pipeline and what the special
/// one gains, its errors, those over seeds, its settings. Cells of what a point does not have are empty.
pub(super) fn csv(chart: &Chart) -> String {
    let keys: BTreeSet<&String> = chart.points.iter().flat_map(|point| point.settings.keys()).collect();
    let front = front_of(&chart.points, "rel_mse");
    let mut head = ["id", "label", "method", "seeds", "front", "ranked", "rays", "device_bytes"]
        .map(String::from)
        .to_vec();
    let spreads = |name: &str| ["", "_min", "_max"].map(|suffix| format!("{name}{suffix}"));
    head.extend(spreads("ms"));
    head.extend(["general_ms", "gain"].map(String::from));
    chart.metrics.iter().for_each(|metric| head.extend(spreads(&metric.key)));
    head.extend(["mean_bias", "mean_bias_se", "rel_mse_of_mean", "systematic"].map(String::from));
    head.extend(keys.iter().map(|key| (*key).clone()));
    let mut text = line(&head);
    for (index, point) in chart.points.iter().enumerate() {
        let spread = |spread: Option<&Spread>| match spread {
            Some(spread) => [spread.median, spread.min, spread.max].map(|value| value.to_string()),
            None => [const { String::new() }; 3],
        };
        let mut cells = vec![
            point.id.clone(),
            point.label.clone(),
            point.method.clone(),
            point.seeds.to_string(),
            front.contains(&index).to_string(),
            point.ranked.to_string(),
            point.rays.to_string(),
            point.device_bytes.to_string(),
        ];
        cells.extend(spread(Some(&point.ms)));
        let gain = point.general_ms.map(|ms| ms / point.ms.median);
        let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
        cells.extend([point.general_ms, gain].map(number));
        chart.metrics.iter().for_each(|metric| cells.extend(spread(point.metrics.get(&metric.key))));
        let over_seeds = point.over_seeds;
        let of = |value: fn(&SeedErrors) -> Option<f64>| number(over_seeds.as_ref().and_then(value));
        cells.extend([
            of(|errors| Some(errors.bias)),
            of(|errors| errors.bias_se),
            of(|errors| errors.rel_mse_of_mean),
            of(|errors| errors.systematic),
        ]);
        cells.extend(keys.iter().map(|key| match point.settings.get(*key) {
            Some(serde_json::Value::String(word)) => word.clone(),
            Some(value) => value.to_string(),
            None => String::new(),
        }));
        text += &line(&cells);
    }
    text
}

fn line(cells: &[String]) -> String {
    let cell = |cell: &String| {
        if cell.contains([',', '"', '\n', '\r']) {
            format!("\"{}\"", cell.replace('"', "\"\""))
        } else {
            cell.clone()
        }
    };
    cells.iter().map(cell).collect::<Vec<_>>().join(",") + "\r\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_that_need_quotes_have_them() {
        let cells = ["a", "b,c", "d\"e", "f\ng"].map(String::from);
        assert_eq!(line(&cells), "a,\"b,c\",\"d\"\"e\",\"f\ng\"\r\n");
    }
}

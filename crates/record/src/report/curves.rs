//! A page of a table and of curves over time, for what isn't a run: of the same look, as whole, without a script.

use std::fmt::Write;

use super::STYLE;
use super::chart::{Line, TimeChart};
use super::text::{Unit, escape};

/// What the page shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurvesPage {
    /// Its title.
    pub title: String,
    /// Sentences below it.
    pub facts: Vec<String>,
    /// The table's head, and its rows; numbers stand right from the second column on.
    pub head: Vec<String>,
    /// Its rows.
    pub rows: Vec<Vec<String>>,
    /// A list below the table, and what it is of.
    pub listed: (String, Vec<String>),
    /// The curves.
    pub charts: Vec<CurveChart>,
}

/// In what a chart's values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Lengths, m.
    Length,
    /// Angles, rad.
    Angle,
    /// Standard deviations.
    Sigmas,
}

/// Curves over the same times.
#[derive(Clone, Debug, PartialEq)]
pub struct CurveChart {
    /// What is shown.
    pub title: String,
    /// In what.
    pub quantity: Quantity,
    /// When, s, in order.
    pub times_s: Vec<f64>,
    /// Each with its name, and one value per time.
    pub curves: Vec<(String, Vec<f64>)>,
}

impl CurvesPage {
    /// The page as a whole HTML file.
    pub fn html(&self) -> String {
        let title = escape(&self.title);
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n<meta name=\"generator\" content=\"omnibase\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>{title}</h1>\n"
        );
        for fact in &self.facts {
            let _ = writeln!(html, "<p class=\"facts\">{}</p>", escape(fact));
        }
        let row = |cells: &[String], tag: &str| {
            let cell = |(number, cell): (usize, &String)| {
                let class = if number > 0 { " class=\"number\"" } else { "" };
                format!("<{tag}{class}>{}</{tag}>", escape(cell))
            };
            format!("<tr>{}</tr>\n", cells.iter().enumerate().map(cell).collect::<String>())
        };
        let rows: String = self.rows.iter().map(|cells| row(cells, "td")).collect();
        let _ = write!(
            html,
            "<h2>Table</h2>\n<table>\n<thead>{}</thead>\n{rows}</table>\n",
            row(&self.head, "th")
        );
        let (what, list) = &self.listed;
        if !list.is_empty() {
            let items: String = list.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
            let _ = write!(html, "<h2>{}</h2>\n<ul>\n{items}</ul>\n", escape(what));
        }
        html.push_str("<h2>Curves</h2>\n");
        html.extend(self.charts.iter().map(CurveChart::html));
        html.push_str("</main>\n</body>\n</html>\n");
        html
    }
}

impl CurveChart {
    fn html(&self) -> String {
        let greatest = self
            .curves
            .iter()
            .flat_map(|(_, values)| values)
            .fold(0.0, |most: f64, value| most.max(value.abs()));
        let unit = match self.quantity {
            Quantity::Length => Unit::length(greatest),
            Quantity::Angle => Unit::angle(greatest),
            Quantity::Sigmas => Unit::plain("σ"),
        };
        let numbered = self.curves.iter().enumerate();
        let lines = numbered.map(|(number, (name, values))| Line {
            name: name.clone(),
            class: format!("w{}", number % 8 + 1),
            values,
        });
        let lines = lines.collect();
        TimeChart { title: &self.title, unit, times: &self.times_s, lines, limits: Vec::new(), marked: &[] }
            .html()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_holds_its_table_its_list_and_a_chart_each() {
        let chart = |title: &str, quantity| CurveChart {
            title: title.to_owned(),
            quantity,
            times_s: vec![0.0, 1.0, 2.0],
            curves: vec![
                ("before".to_owned(), vec![0.0, 0.01, 0.02]),
                ("after".to_owned(), vec![0.0, 1e-3, 2e-3]),
            ],
        };
        let page = CurvesPage {
            title: "found <b>".to_owned(),
            facts: vec!["2 runs".to_owned()],
            head: vec!["what".to_owned(), "found".to_owned()],
            rows: vec![vec!["wheel_1 radius".to_owned(), "100.1".to_owned()]],
            listed: ("Not observed".to_owned(), vec!["where base is".to_owned()]),
            charts: vec![chart("distance", Quantity::Length), chart("residuals", Quantity::Sigmas)],
        };
        let html = page.html();
        for part in [
            "<h1>found &lt;b&gt;</h1>",
            "<td>wheel_1 radius</td><td class=\"number\">100.1</td>",
            "<li>where base is</li>",
            ">mm</text>",
            ">σ</text>",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(html.matches("<figcaption>").count(), 2);
        assert!(!html.contains("<script") && html.ends_with("</html>\n"));
    }
}

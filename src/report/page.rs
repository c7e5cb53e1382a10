//! What self-contained HTML pages are made of: text, pictures inside the page, and a common look.

use std::fmt::Write;

use super::{FloatImage, output};
use crate::error::Result;

/// Style of every page: dark or light as the reader prefers, light in print, and no wider than a phone.
const STYLE: &str = "\
:root { color-scheme: light dark; --ink: #222; --soft: #5a5a5a; --paper: #fff; --rule: #ddd; --yes: #1d6f42; \
--no: #a02020 }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e4e4; --soft: #a8a8a8; --paper: #17181a; --rule: #3a3c40; \
--yes: #6fcf97; --no: #f08a80 } }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 90rem; margin: 2rem auto; padding: 0 1rem; \
color: var(--ink); background: var(--paper); overflow-wrap: break-word }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); gap: 1rem }
figure { margin: 0; break-inside: avoid } img, svg { width: 100%; height: auto; display: block }
figcaption, .soft { font-size: .875rem; color: var(--soft) }
td:first-child { min-width: 10em } .table { overflow-x: auto } table { border-collapse: collapse; margin: 1rem 0 }
th, td { padding: .25rem .75rem; text-align: left; vertical-align: top; border-bottom: 1px solid var(--rule) }
td.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }
.no { color: var(--no); font-weight: 600 } .yes { color: var(--yes) }
@media (max-width: 40rem) { body { margin: 1rem auto } th, td { padding: .2rem .4rem; font-size: .8125rem } }
@media print { :root { --ink: #000; --soft: #444; --paper: #fff; --rule: #bbb; color-scheme: light } \
body { max-width: none; margin: 0; font-size: 10pt } .table { overflow: visible } \
th, td { padding: .1rem .3rem; font-size: 7pt } \
.pictures { grid-template-columns: repeat(2, 1fr) } h2 { break-after: avoid } }";

/// A page that needs no other file and no network.
pub struct Page(String);

impl Page {
    /// An empty page with `title` as its heading.
    pub fn new(title: &str) -> Self {
        let title = escape(title);
        Self(format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
             content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>\n{STYLE}\n\
             </style>\n</head>\n<body>\n<h1>{title}</h1>\n"
        ))
    }

    /// A heading.
    pub fn heading(&mut self, text: &str) {
        self.raw(format_args!("<h2>{}</h2>\n", escape(text)));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) {
        self.raw(format_args!("<p>{}</p>\n", escape(text)));
    }

    /// A list with a dot before every line; nothing if there is none.
    pub fn list<'t>(&mut self, lines: impl IntoIterator<Item = &'t str>) {
        let items: String = lines.into_iter().map(|line| format!("<li>{}</li>\n", escape(line))).collect();
        if !items.is_empty() {
            self.raw(format_args!("<ul>\n{items}</ul>\n"));
        }
    }

    /// Pictures side by side, as many as fit.
    pub fn figures(&mut self, figures: &[Figure]) {
        self.0.push_str("<div class=\"pictures\">\n");
        for Figure { caption, body } in figures {
            self.raw(format_args!("<figure>{body}<figcaption>{}</figcaption></figure>\n", escape(caption)));
        }
        self.0.push_str("</div>\n");
    }

    /// A table, which scrolls by itself where the page is narrower.
    pub fn table(&mut self, head: &[&str], rows: &[Vec<Cell>]) {
        self.0.push_str("<div class=\"table\"><table>\n<thead><tr>");
        for title in head {
            self.raw(format_args!("<th>{}</th>", escape(title)));
        }
        self.0.push_str("</tr></thead>\n<tbody>\n");
        for row in rows {
            self.0.push_str("<tr>");
            for Cell { text, class } in row {
                let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
                self.raw(format_args!("<td{class}>{}</td>", escape(text)));
            }
            self.0.push_str("</tr>\n");
        }
        self.0.push_str("</tbody>\n</table></div>\n");
    }

    /// The finished document.
    pub fn finish(mut self) -> String {
        self.0.push_str("</body>\n</html>\n");
        self.0
    }

    fn raw(&mut self, arguments: std::fmt::Arguments) {
        // Writing to a string cannot fail.
        let _ = self.0.write_fmt(arguments);
    }
}

/// One cell of a table.
pub struct Cell {
    text: String,
    class: &'static str,
}

impl Cell {
    /// Words.
    pub fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), class: "" }
    }

    /// Digits, flush right.
    pub fn number(text: impl Into<String>) -> Self {
        Self { text: text.into(), class: "number" }
    }

    /// Words in the colour of good or bad news.
    pub fn verdict(good: bool, text: impl Into<String>) -> Self {
        Self { text: text.into(), class: if good { "yes" } else { "no" } }
    }
}

/// A picture inside the page, and what it shows.
pub struct Figure {
    caption: String,
    body: String,
}

impl Figure {
    /// An image, as PNG inside the page.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn image(caption: &str, image: &FloatImage) -> Result<Self> {
        let png = base64::encode(output::small_png(image)?);
        let body = format!("<img alt=\"{}\" src=\"data:image/png;base64,{png}\">", escape(caption));
        Ok(Self { caption: caption.into(), body })
    }

    /// An SVG document of black on white, which takes on the page's own colours.
    pub fn plot(caption: &str, svg: &str) -> Self {
        // Inside HTML an SVG needs no namespace, and its black is whatever the page writes in.
        let body = svg
            .replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1)
            .replace("\"#000000\"", "\"currentColor\"")
            .replace("fill=\"#FFFFFF\"", "fill=\"none\"");
        Self { caption: caption.into(), body }
    }
}

/// `text` as HTML shows it, inside of quotes too.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

//! One self-contained page of all figures and claims.

use std::fmt::Write;
use std::path::Path;

use vertex_tracing::error::{Error, Result};

use crate::claims::Claim;
use crate::lab::Lab;
use crate::plates::{Plate, Row};

const STYLE: &str = "\
body { font: 16px/1.5 system-ui, sans-serif; max-width: 90rem; margin: 2rem auto; padding: 0 1rem; \
color: #222; background: #fff }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 1rem }
figure { margin: 0 } img { width: 100%; height: auto; display: block }
figcaption { font-size: .875rem; color: #555 }
table { border-collapse: collapse; margin: 1rem 0 } th, td { padding: .25rem .75rem; text-align: left; \
vertical-align: top; border-bottom: 1px solid #ddd }
td.number { text-align: right; font-variant-numeric: tabular-nums }
.no { color: #a02020; font-weight: 600 } .yes { color: #1d6f42 }";

/// The page; its pictures are read from `folder`, where they were written.
pub fn html(lab: &Lab, plates: &[Plate], claims: &[Claim], folder: &Path) -> Result<String> {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Vertex tracing: the paper's \
         figures</title>\n<style>\n{STYLE}\n</style>\n<h1>The paper's figures and claims</h1>\n<p>Measured on \
         {}. Times are medians of three frames, from the camera to the finished linear image; PSNR is over \
         specular pixels against the conventional picture.</p>\n",
        escape(&lab.device())
    );
    for plate in plates {
        push(&mut page, format_args!("<h2>{}</h2>\n<p>{}</p>\n", plate.title, escape(plate.caption)));
        page.push_str("<div class=\"pictures\">\n");
        for picture in &plate.pictures {
            let path = folder.join(format!("{}.png", picture.name));
            let png = std::fs::read(&path).map_err(Error::io(&path))?;
            let caption = escape(&picture.caption);
            push(
                &mut page,
                format_args!(
                    "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{}\"><figcaption>{caption}\
                     </figcaption></figure>\n",
                    base64::encode(png)
                ),
            );
        }
        page.push_str("</div>\n");
        table(&mut page, &plate.rows);
    }
    page.push_str("<h2>Claims</h2>\n<table>\n<tr><th>The paper<th>Here<th>Judged by<th>Holds\n");
    for claim in claims {
        let (class, verdict) = if claim.holds { ("yes", "yes") } else { ("no", "no") };
        push(
            &mut page,
            format_args!(
                "<tr><td>{}<td>{}<td>{}<td class=\"{class}\">{verdict}\n",
                escape(claim.claim),
                escape(&claim.measured),
                escape(claim.judged)
            ),
        );
    }
    page.push_str("</table>\n</html>\n");
    Ok(page)
}

fn table(page: &mut String, rows: &[Row]) {
    page.push_str(
        "<table>\n<tr><th>Picture<th>Samples<th>Rays<th>Time<th>PSNR<th>Defined faces<th>Undefined faces\n",
    );
    for row in rows {
        let count = |value: Option<u64>| value.map_or("–".into(), |value| value.to_string());
        let psnr = row.psnr.map_or("–".into(), |psnr| format!("{psnr:.1} dB"));
        let cells = [
            count(row.samples),
            row.rays.to_string(),
            format!("{:.0} ms", row.ms),
            psnr,
            count(row.faces.map(|faces| faces.0)),
            count(row.faces.map(|faces| faces.1)),
        ];
        push(page, format_args!("<tr><td>{}", escape(&row.what)));
        for cell in cells {
            push(page, format_args!("<td class=\"number\">{cell}"));
        }
        page.push('\n');
    }
    page.push_str("</table>\n");
}

/// Appends; writing to a string cannot fail.
fn push(page: &mut String, arguments: std::fmt::Arguments) {
    let _ = page.write_fmt(arguments);
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

//! One self-contained page of all figures and claims.

use vertex_tracing::error::Result;
use vertex_tracing::report::page::{Cell, Figure, Page};

use crate::claims::Claim;
use crate::lab::Lab;
use crate::plates::{Plate, Row};

/// The page.
pub fn html(lab: &Lab, plates: &[Plate], claims: &[Claim]) -> Result<String> {
    let mut page = Page::new("Vertex tracing: the paper's figures and claims");
    page.paragraph(&format!(
        "Measured on {}. Times are medians of three frames, from the camera to the finished linear image; PSNR is \
         over specular pixels against the conventional picture.",
        lab.device()
    ));
    for plate in plates {
        page.heading(plate.title);
        page.paragraph(plate.caption);
        let figures = plate.pictures.iter().map(|picture| Figure::image(&picture.caption, &picture.image));
        page.figures(&figures.collect::<Result<Vec<_>>>()?);
        table(&mut page, &plate.rows);
    }
    page.heading("Claims");
    let rows: Vec<Vec<Cell>> = claims
        .iter()
        .map(|claim| {
            vec![
                Cell::text(claim.claim),
                Cell::text(&claim.measured),
                Cell::text(claim.judged),
                Cell::verdict(claim.holds, if claim.holds { "yes" } else { "no" }),
            ]
        })
        .collect();
    page.table(&["The paper", "Here", "Judged by", "Holds"], &rows);
    Ok(page.finish())
}

fn table(page: &mut Page, rows: &[Row]) {
    let count = |value: Option<u64>| Cell::number(value.map_or("–".into(), |value| value.to_string()));
    let cells = |row: &Row| {
        vec![
            Cell::text(&row.what),
            count(row.samples),
            count(Some(row.rays)),
            Cell::number(format!("{:.0} ms", row.ms)),
            Cell::number(row.psnr.map_or("–".into(), |psnr| format!("{psnr:.1} dB"))),
            count(row.faces.map(|faces| faces.0)),
            count(row.faces.map(|faces| faces.1)),
        ]
    };
    let head = ["Picture", "Samples", "Rays", "Time", "PSNR", "Defined faces", "Undefined faces"];
    page.table(&head, &rows.iter().map(cells).collect::<Vec<_>>());
}

//! The tables of what was measured, and whether they hold what is claimed.

use std::fmt::Write;

use crate::measure::{AA_SAMPLES, BUDGETS, Curve, Measured, Reached, SPP, TARGETS};

/// The whole page.
pub fn markdown(all: &[Measured], device: &str, files: &[String]) -> String {
    let mut page = format!(
        "# Samples against error\n\n\
         Written by `make samples{}` on {device}: 1280x1024, depth 5, over the specular pixels, against the reference\n\
         tracer at one sample a pixel, sRGB-encoded. Rays are secondary ones: reflected and transmitted by vertices,\n\
         and all rays of pixels that are traced one by one.\n",
        if files.is_empty() { "" } else { " SCENES='cup5k/scene.glb glass5k/scene.glb'" },
    );
    page += "\n## At equal budgets\n\n\
             | scene | shadows | budget | paper: samples | rays | PSNR | p99 | exact: samples | rays | PSNR | p99 |\n\
             |---|---|---|---|---|---|---|---|---|---|---|\n";
    for scene in all {
        for (budget, (paper, exact)) in BUDGETS.iter().zip(scene.paper.rows.iter().zip(&scene.exact.rows)) {
            let _ = write!(page, "| {} | {} | {budget} ", scene.name, scene.shadows);
            for row in [paper, exact] {
                let psnr = row.error.psnr.map_or("equal".into(), |psnr| format!("{psnr:.1} dB"));
                let _ = write!(page, "| {} | {} | {psnr} | {:.3} ", row.samples, row.rays, row.error.p99);
            }
            page += "|\n";
        }
    }
    page += "\n## At equal error\n\n\
             Samples (secondary rays) for a PSNR; \"conventional\" are the secondary rays of one sample a specular pixel.\n\n\
             | scene | shadows | | 30 dB | 35 dB | 40 dB | conventional | at 35 dB |\n|---|---|---|---|---|---|---|---|\n";
    for scene in all {
        for (name, curve) in [("paper", &scene.paper), ("exact", &scene.exact)] {
            let _ = write!(page, "| {} | {} | {name} ", scene.name, scene.shadows);
            for reached in curve.targets {
                page += &cell(reached);
            }
            let factor = curve.targets[1].map_or("".into(), |(_, rays)| {
                format!("{:.1} x fewer rays", scene.conventional as f64 / rays)
            });
            let _ = writeln!(page, "| {} | {factor} |", scene.conventional);
        }
    }
    page += &gains(all);
    let _ = write!(
        page,
        "\n## Anti-aliasing without a ray\n\n\
         RMSE against {} samples a pixel: `--ss 4 --max-samples {AA_SAMPLES} --sparing`, and the tracer with 1 to 4 a pixel.\n\n\
         | scene | shadows | --ss 4 |",
        SPP[SPP.len() - 1]
    );
    for spp in &SPP[..SPP.len() - 1] {
        let _ = write!(page, " {spp} spp |");
    }
    page += " matched |\n|---|---|---|---|---|---|---|---|\n";
    for scene in all.iter().filter(|scene| !scene.aliasing.is_empty()) {
        let _ = write!(page, "| {} | {} ", scene.name, scene.shadows);
        for rmse in &scene.aliasing {
            let _ = write!(page, "| {rmse:.4} ");
        }
        let own = scene.aliasing[0];
        let matched =
            SPP.iter().zip(&scene.aliasing[1..]).filter(|&(_, &rmse)| own <= rmse).map(|(spp, _)| spp);
        let _ = writeln!(page, "| {} |", matched.max().map_or("none".into(), |spp| format!("{spp} spp")));
    }
    page
}

fn cell(reached: Reached) -> String {
    reached.map_or("| not reached ".into(), |(samples, rays)| format!("| {samples:.0} ({rays:.0}) "))
}

/// Gain in dB, and paper's secondary rays and vertices as multiples of exact's. Vertices alone leave out the pixels that
/// exact traces.
fn gains(all: &[Measured]) -> String {
    let mut page = String::from(
        "\n## Gain\n\nOver the paper's at one budget for vertices and pixels, and at one number of vertices, when exact spends the rays \
         in brackets\non pixels besides (paper's; exact's).\n\n\
         | scene | shadows | at a budget of 12k | at 12k vertices | fewer rays for 30 dB | for 35 dB | for 40 dB | fewer vertices \
         for 30 dB | for 35 dB |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for scene in all {
        let psnr = |curve: &Curve| curve.rows[1].error.psnr.unwrap_or(f64::INFINITY);
        let gain = psnr(&scene.exact) - psnr(&scene.paper);
        let [(paper, paper_rays), (exact, exact_rays)] = [scene.paper.at_vertices, scene.exact.at_vertices];
        let _ = write!(page, "| {} | {} | {gain:+.1} dB ", scene.name, scene.shadows);
        let _ = write!(page, "| {:+.1} dB ({paper_rays:.0}; {exact_rays:.0}) ", exact - paper);
        let fewer = |target: usize, of: fn((f64, f64)) -> f64| {
            let [paper, exact] =
                [&scene.paper, &scene.exact].map(|curve: &Curve| curve.targets[target].map(of));
            match (paper, exact) {
                (Some(paper), Some(exact)) => format!("| {:.1} x ", paper / exact),
                (None, Some(_)) => "| paper never ".into(),
                _ => "| not reached ".into(),
            }
        };
        for target in 0..TARGETS.len() {
            page += &fewer(target, |(_, rays)| rays);
        }
        for target in 0..2 {
            page += &fewer(target, |(samples, _)| samples);
        }
        page += "|\n";
    }
    page
}

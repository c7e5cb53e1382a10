//! Image files and image differences against values computed by hand.

use std::fs;
#[cfg(unix)]
use std::{process::Command, sync::mpsc, thread, time::Duration};

use vertex_tracing::report::{
    Encoding, FloatImage, compare,
    image::srgb_decode,
    output::{check_writable, write_file, write_image},
};

fn row(pixels: &[[f32; 3]]) -> FloatImage {
    FloatImage { width: pixels.len() as u32, height: 1, pixels: pixels.to_vec() }
}

fn assert_near(value: f64, expected: f64) {
    assert!((value - expected).abs() < 1e-5, "{value} instead of {expected}");
}

#[test]
fn linear_differences() {
    let a = row(&[[0.0; 3], [0.5; 3]]);
    let b = row(&[[0.3, 0.0, 0.0], [0.5, 0.45, 0.5]]);
    let c = compare(&a, &b, None, Encoding::Linear).unwrap();
    // Six channels, two of which differ: 0.3 and 0.05.
    assert_near(c.rmse, (0.0925_f64 / 6.0).sqrt());
    assert_near(c.psnr.unwrap(), 18.120_097);
    assert_near(c.max, 0.3);
    assert_near(c.over_0_1, 0.5);
    // Between the two ranks 0.05 and 0.3, at 0.99.
    assert_near(c.p99, 0.2975);
    assert!(c.flip > 0.0 && c.flip < 1.0);
}

#[test]
fn encoded_differences_are_those_a_display_shows() {
    let a = row(&[[0.0; 3]]);
    let b = row(&[[0.214_041_14; 3]]); // one half, sRGB-encoded
    let c = compare(&a, &b, None, Encoding::Srgb).unwrap();
    assert_near(c.rmse, 0.5);
    assert_near(c.psnr.unwrap(), 6.020_600);
    assert_near(c.over_0_1, 1.0);
}

#[test]
fn values_are_clamped_and_identical_images_have_no_psnr() {
    let a = row(&[[2.0, -1.0, 0.25]]);
    let b = row(&[[f32::INFINITY, 0.0, 0.25]]);
    let c = compare(&a, &b, None, Encoding::Srgb).unwrap();
    assert_eq!((c.rmse, c.psnr, c.flip, c.max), (0.0, None, 0.0, 0.0));
    assert_eq!(serde_json::json!(c)["psnr"], serde_json::Value::Null);
}

#[test]
fn mask_chooses_the_pixels() {
    let a = row(&[[0.0; 3], [0.0; 3], [0.0; 3]]);
    let b = row(&[[1.0; 3], [0.2; 3], [0.0; 3]]);
    let c = compare(&a, &b, Some(&[false, true, true]), Encoding::Linear).unwrap();
    assert_near(c.rmse, (0.04_f64 / 2.0).sqrt());
    assert_near(c.max, f64::from(0.2_f32));
    let whole = compare(&a, &b, None, Encoding::Linear).unwrap();
    assert!(whole.flip > c.flip);
}

#[test]
fn what_cannot_be_compared_is_said() {
    let a = row(&[[0.0; 3], [0.0; 3]]);
    let nan = row(&[[0.0; 3], [0.0, f32::NAN, 0.0]]);
    let problem =
        |b: &FloatImage, mask: Option<&[bool]>| compare(&a, b, mask, Encoding::Srgb).unwrap_err().to_string();
    assert_eq!(problem(&row(&[[0.0; 3]]), None), "images differ in size: 2x1 and 1x1");
    assert_eq!(problem(&a, Some(&[true])), "mask has 1 pixels, the images 2 (2x1)");
    assert_eq!(problem(&a, Some(&[false, false])), "no pixel to compare: the mask is empty");
    assert_eq!(problem(&nan, None), "pixel (1, 0) of the second image is NaN");
    assert!(compare(&a, &nan, Some(&[true, false]), Encoding::Srgb).is_ok(), "NaN outside of the mask");
}

#[test]
fn result_does_not_depend_on_the_number_of_threads() {
    let wave = |phase: f32| {
        FloatImage::from_fn(97, 31, |x, y| [(x as f32 * 0.3 + phase).sin().abs(), 0.2, y as f32 / 31.0])
    };
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| compare(&wave(0.0), &wave(0.1), None, Encoding::Srgb).unwrap())
    };
    assert_eq!(run(1), run(5));
}

#[test]
fn float_formats_return_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let values = [0.0, -0.0, 1.0, -3.5, 1e-40, 65504.0, 1e30, f32::MIN_POSITIVE, 0.1];
    let image =
        FloatImage::from_fn(5, 3, |x, y| std::array::from_fn(|c| values[(x + 2 * y) as usize % 7 + c]));
    for name in ["image.pfm", "image.exr", "IMAGE.PFM"] {
        let path = folder.path().join(name);
        write_image(&path, &image, 3.0).unwrap();
        let back = FloatImage::read(&path).unwrap();
        let bits =
            |image: &FloatImage| -> Vec<u32> { image.pixels.iter().flatten().map(|v| v.to_bits()).collect() };
        assert_eq!((back.width, back.height, bits(&back)), (5, 3, bits(&image)), "{name}");
    }
}

#[test]
fn pfm_is_little_endian_from_the_bottom_row_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.pfm");
    let image = FloatImage { width: 1, height: 2, pixels: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]] };
    write_image(&path, &image, 0.0).unwrap();
    let mut expected = b"PF\n1 2\n-1.0\n".to_vec();
    expected.extend([4.0_f32, 5.0, 6.0, 1.0, 2.0, 3.0].iter().flat_map(|v| v.to_le_bytes()));
    assert_eq!(fs::read(path).unwrap(), expected);
}

#[test]
fn png_bytes_come_back_and_exposure_brightens() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bytes.png");
    let image = FloatImage::from_fn(256, 1, |x, _| [srgb_decode(x as f32 / 255.0); 3]);
    write_image(&path, &image, 0.0).unwrap();
    let back = image::open(&path).unwrap().into_rgb8();
    assert!(back.pixels().enumerate().all(|(x, pixel)| pixel.0 == [x as u8; 3]));
    let read = FloatImage::read(&path).unwrap();
    assert!(read.pixels.iter().zip(&image.pixels).all(|(a, b)| (a[0] - b[0]).abs() < 1e-6));

    write_image(&path, &row(&[[0.107_020_57, f32::NAN, 9.0]]), 1.0).unwrap();
    let exposed = image::open(&path).unwrap().into_rgb8();
    assert_eq!(exposed.get_pixel(0, 0).0, [128, 0, 255]); // 2 × 0.10702 is one half, sRGB-encoded
}

#[test]
fn files_appear_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |folder: &std::path::Path| -> Vec<_> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    };
    // A folder in the way lets everything up to the rename succeed.
    let blocked = folder.path().join("blocked");
    fs::create_dir(&blocked).unwrap();
    assert!(write_file(&blocked, b"new").is_err());
    assert_eq!(inside(folder.path()), ["blocked"]);
    assert_eq!(inside(&blocked).len(), 0);

    let file = folder.path().join("blocked/file");
    write_file(&file, b"old").unwrap();
    write_file(&file, b"new").unwrap();
    assert_eq!(fs::read(&file).unwrap(), b"new");
    assert_eq!(inside(&blocked), ["file"]);

    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::write(blocked.join("ordinary"), "").unwrap();
        let mode = |name| fs::metadata(blocked.join(name)).unwrap().permissions().mode();
        assert_eq!(mode("file"), mode("ordinary"), "as any new file");
    }
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_what_is_no_file_is_written_to() {
    use std::os::unix::fs::{FileTypeExt, symlink};
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("far")).unwrap();
    symlink("far/link", path("link")).unwrap();
    symlink("file", path("far/link")).unwrap();
    // The file that the links lead to, when it is not there yet and when it is.
    for bytes in [b"old", b"new"] {
        check_writable(&path("link")).unwrap();
        write_file(&path("link"), bytes).unwrap();
        assert_eq!(fs::read(path("far/file")).unwrap(), bytes);
    }
    for link in ["link", "far/link"] {
        assert!(path(link).is_symlink(), "{link} was replaced");
    }
    assert_eq!(fs::read_dir(path("far")).unwrap().count(), 2, "written beside the target, and renamed");

    symlink("absent/file", path("nowhere")).unwrap();
    symlink("loop", path("loop")).unwrap();
    for (name, expected) in [("nowhere", "absent does not exist"), ("loop", "too many symbolic links")] {
        let problem = check_writable(&path(name)).unwrap_err().to_string();
        assert!(problem.contains(expected), "{problem}");
        assert!(write_file(&path(name), b"new").is_err() && path(name).is_symlink());
    }

    symlink("/dev/null", path("null")).unwrap();
    check_writable(&path("null")).unwrap();
    write_file(&path("null"), b"new").unwrap();
    assert!(path("null").is_symlink());

    let pipe = path("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    check_writable(&pipe).unwrap();
    let (sender, read) = mpsc::channel();
    let reader = pipe.clone();
    thread::spawn(move || sender.send(fs::read(reader).unwrap()));
    write_file(&pipe, b"new").unwrap();
    assert!(fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo(), "the pipe was replaced");
    assert_eq!(read.recv_timeout(Duration::from_secs(60)).unwrap(), b"new");
}

#[test]
fn unwritable_places_are_found_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let in_folder = |name: &str| folder.path().join(name);
    fs::write(in_folder("file"), "").unwrap();
    check_writable(&in_folder("new.png")).unwrap();
    assert!(!in_folder("new.png").exists());
    for (path, expected) in [
        (in_folder("absent/new.png"), "does not exist; create it first"),
        (in_folder("file/new.png"), "is not a folder"),
        (in_folder(""), "is a folder; name a file in it"),
        ("/proc/new.png".into(), "cannot write to folder /proc"),
    ] {
        let problem = check_writable(&path).unwrap_err().to_string();
        assert!(problem.contains(expected), "{problem:?} should contain {expected:?}");
    }
    let problem = write_image(&in_folder("new.gif"), &row(&[[0.0; 3]]), 0.0).unwrap_err().to_string();
    assert!(problem.ends_with("images are not written as .gif; name a .png, .exr or .pfm file"), "{problem}");
}

#[test]
fn broken_images_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good.png");
    write_image(&good, &row(&[[0.5; 3]; 64]), 0.0).unwrap();
    let png = fs::read(&good).unwrap();
    for (name, bytes) in [("text.png", &b"hello"[..]), ("empty.exr", b""), ("cut.png", &png[..png.len() / 2])]
    {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let problem = FloatImage::read(&path).unwrap_err().to_string();
        assert!(problem.contains(name) && !problem.contains('\n'), "{problem}");
    }
}

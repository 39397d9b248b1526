//! Pixels where they belong: triangles, depth, lines, charts, bars, composition, PNG.

use crate::*;

const RED: Rgb = [220, 40, 40];
const BLUE: Rgb = [40, 60, 220];

/// Looking down the z axis, x to the right and y up.
fn from_above(width: u32, height: u32) -> View {
    View { width, height, azimuth: -90.0, elevation: 90.0, ..View::default() }
}

/// How much of a pixel is of a colour's hue: the difference to a shade of it.
fn is_shade_of(pixel: Rgb, colour: Rgb) -> bool {
    let strength = f64::from(*pixel.iter().max().unwrap_or(&0)) / f64::from(*colour.iter().max().unwrap_or(&1));
    (0..3).all(|k| (f64::from(pixel[k]) - strength * f64::from(colour[k])).abs() < 30.0)
}

#[test]
fn a_triangle_covers_its_middle_and_not_the_corners_of_the_picture() {
    let positions = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 3.0, 0.0]];
    let mut scene = Scene::new(&positions, &[[0, 1, 2]]);
    scene.colours = FaceColours::PerFace(&[RED]);
    for supersampling in 1..=4 {
        let image = render_surface(&scene, &View { supersampling, ..from_above(120, 100) }).expect("drawn");
        assert!(is_shade_of(image.pixel(60, 55).expect("inside"), RED), "{:?}", image.pixel(60, 55));
        assert_eq!(image.pixel(2, 2), Some([255, 255, 255]));
        assert_eq!(image.pixel(117, 2), Some([255, 255, 255]));
    }
}

#[test]
fn the_nearer_triangle_wins_whatever_the_order() {
    let positions = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [2.0, 3.0, 1.0]];
    for (triangles, colours) in [([[0, 1, 2], [3, 4, 5]], [RED, BLUE]), ([[3, 4, 5], [0, 1, 2]], [BLUE, RED])] {
        let mut scene = Scene::new(&positions, &triangles);
        scene.colours = FaceColours::PerFace(&colours);
        let above = render_surface(&scene, &from_above(120, 100)).expect("drawn");
        assert!(is_shade_of(above.pixel(60, 60).expect("inside"), BLUE));
        let below = render_surface(&scene, &View { elevation: -90.0, ..from_above(120, 100) }).expect("drawn");
        let pixel = below.pixel(60, 40).expect("inside");
        assert!(pixel[0] > pixel[2], "from below the red one is in front: {pixel:?}");
    }
}

#[test]
fn curves_lie_on_top_and_edges_darken() {
    let positions = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]];
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let mut scene = Scene::new(&positions, &triangles);
    let plain = render_surface(&scene, &from_above(200, 200)).expect("drawn");
    scene.edges = Some(LineStyle { width: 2.0, colour: [0, 0, 0] });
    let wired = render_surface(&scene, &from_above(200, 200)).expect("drawn");
    scene.edges = None;
    scene.curves = &[[0, 2]];
    scene.curve_style = LineStyle { width: 5.0, colour: RED };
    let curved = render_surface(&scene, &from_above(200, 200)).expect("drawn");
    let (middle, off) = ((100, 100), (140, 100));
    assert!(wired.pixel(middle.0, middle.1) < plain.pixel(middle.0, middle.1));
    assert_eq!(wired.pixel(off.0, off.1), plain.pixel(off.0, off.1));
    assert_eq!(curved.pixel(middle.0, middle.1), Some(RED));
    assert_eq!(curved.pixel(off.0, off.1), plain.pixel(off.0, off.1));
}

#[test]
fn bands_give_the_same_picture() {
    // 2400 x 2400 at 3 x 3 samples needs several bands; the middle column must look as in one small band.
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let scene = Scene::new(&positions, &triangles);
    let image = render_surface(&scene, &View { supersampling: 3, ..from_above(2400, 2400) }).expect("drawn");
    let colour = image.pixel(1200, 1300);
    assert!((100..2300).all(|y| image.pixel(1200, y) == colour));
}

#[test]
fn png_decodes_to_the_same_pixels() {
    let mut image = Image::filled(37, 23, [1, 2, 3]).expect("image");
    for (k, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = [(k * 7 % 256) as u8, (k * 31 % 256) as u8, (k / 3 % 256) as u8];
    }
    let bytes = encode_png(&image).expect("encoded");
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("header");
    let mut decoded = vec![0; reader.output_buffer_size().expect("size")];
    let info = reader.next_frame(&mut decoded).expect("frame");
    assert_eq!((info.width, info.height, info.color_type), (37, 23, png::ColorType::Rgb));
    assert_eq!(decoded, image.pixels.as_flattened());
}

#[test]
fn bars_are_proportional_to_shares() {
    let mut values = vec![0.05; 30];
    values.extend([0.95; 60]);
    values.extend([7.0; 10]);
    let series = [Series { label: "only", values: &values, colour: RED }];
    let histogram = Histogram { bins: 10, size: [640, 480], ..Histogram::of_quality("title", &series) };
    let image = render_histogram(&histogram).expect("drawn");
    // The legend lies above row 150, at the left.
    let height = |columns: std::ops::Range<u32>, top: u32| {
        columns.map(|x| (top..480).filter(|&y| image.pixel(x, y) == Some(RED)).count()).max().unwrap_or(0)
    };
    let (left, right) = (height(60..200, 150), height(500..640, 50));
    let ratio = right as f64 / left as f64;
    assert!((ratio - 70.0 / 30.0).abs() < 0.05, "{left} {right} {ratio}");
    assert_eq!(height(250..450, 150), 0);
}

#[test]
fn flipped_faces_of_a_chart_are_red_and_on_top() {
    let uv = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    let mut chart = Chart::new(&uv, &[[0, 2, 1], [0, 2, 3]]);
    chart.colours = FaceColours::Uniform(BLUE);
    chart.size = [200, 200];
    let image = render_chart(&chart).expect("drawn");
    let (flipped, right) = (image.pixel(140, 140).expect("inside"), image.pixel(60, 60).expect("inside"));
    assert!(flipped[0] > 150 && flipped[2] < 80, "{flipped:?}");
    assert_eq!(right, BLUE);
    chart.pattern = Some(Pattern { checkers: Some(1.0), iso: None });
    let checked = render_chart(&chart).expect("drawn");
    assert_ne!(checked.pixel(40, 80), checked.pixel(80, 120));
}

#[test]
fn iso_lines_lie_where_the_chart_says() {
    // A chart of twice the picture's proportions: lines of u at 0, 1 and 2 of a square of side 2.
    let uv = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    let mut chart = Chart::new(&uv, &[[0, 1, 2], [0, 2, 3]]);
    (chart.colours, chart.edges, chart.size) = (FaceColours::Uniform([250, 250, 250]), None, [200, 200]);
    chart.pattern = Some(Pattern { checkers: None, iso: Some(1.0) });
    let image = render_chart(&chart).expect("drawn");
    let (vertical, horizontal) = (image.pixel(100, 60).expect("inside"), image.pixel(60, 100).expect("inside"));
    // A line as wide as a pixel and a half may lie between two pixels.
    assert!(vertical[2] > vertical[0] + 80 && horizontal[0] > horizontal[2] + 80, "{vertical:?} {horizontal:?}");
    assert_eq!(image.pixel(60, 60), Some([250, 250, 250]));
    chart.pattern = Some(Pattern { checkers: Some(-1.0), iso: None });
    assert!(matches!(render_chart(&chart), Err(RenderError::BadParameter { .. })));
}

#[test]
fn a_pattern_on_the_surface_follows_the_corners_of_its_faces() {
    let positions = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.0], [0.0, 4.0, 0.0]];
    let triangles = [[0, 1, 2], [0, 2, 3]];
    let mut scene = Scene::new(&positions, &triangles);
    scene.colours = FaceColours::Uniform([240, 240, 240]);
    let plain = render_surface(&scene, &from_above(200, 200)).expect("drawn");
    // The first face (lower right) has lines of u at its quarters, the second has no chart.
    let corner_uv = [Some([[0.0, 0.3], [4.0, 0.3], [4.0, 0.3]]), None];
    scene.pattern = Some(SurfacePattern { corner_uv: &corner_uv, pattern: Pattern { checkers: None, iso: Some(1.0) } });
    let drawn = render_surface(&scene, &from_above(200, 200)).expect("drawn");
    let side = 0.94 * 200.0;
    let at = |x: f64, y: f64| ((100.0 + (x - 2.0) / 4.0 * side) as u32, (100.0 - (y - 2.0) / 4.0 * side) as u32);
    let (on, off, other) = (at(3.0, 0.7), at(3.5, 0.7), at(1.0, 3.0));
    assert!(is_shade_of(drawn.pixel(on.0, on.1).expect("inside"), ISO_U), "{:?}", drawn.pixel(on.0, on.1));
    assert_eq!(drawn.pixel(off.0, off.1), plain.pixel(off.0, off.1));
    assert_eq!(drawn.pixel(other.0, other.1), plain.pixel(other.0, other.1));
    scene.pattern = Some(SurfacePattern { corner_uv: &corner_uv[..1], pattern: Pattern::default() });
    assert!(matches!(render_surface(&scene, &from_above(200, 200)), Err(RenderError::LengthMismatch { .. })));
    let nan = [Some([[f64::NAN; 2]; 3]), None];
    scene.pattern = Some(SurfacePattern { corner_uv: &nan, pattern: Pattern::default() });
    assert!(matches!(render_surface(&scene, &from_above(200, 200)), Err(RenderError::NonFinite { .. })));
}

#[test]
fn images_stand_side_by_side() {
    let (one, two) = (Image::filled(40, 30, RED).expect("image"), Image::filled(50, 20, BLUE).expect("image"));
    let row = side_by_side(&[one.clone(), two.clone()], &[]).expect("row");
    assert_eq!((row.width, row.height), (102, 30));
    assert_eq!((row.pixel(0, 0), row.pixel(52, 19), row.pixel(45, 0)), (Some(RED), Some(BLUE), Some([255, 255, 255])));
    let named = side_by_side(&[one.clone(), two], &["before", "after"]).expect("row");
    let lower = named.height - 30;
    assert_eq!((named.pixel(0, lower), named.pixel(0, 0)), (Some(RED), Some([255, 255, 255])));
    assert!(matches!(side_by_side(&[one], &["a", "b"]), Err(RenderError::LengthMismatch { .. })));
    assert!(matches!(side_by_side(&[], &[]), Err(RenderError::Empty { .. })));
}

#[test]
fn senseless_input_is_refused() {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, f64::NAN, 0.0], [0.0, 1.0, 0.0]];
    let fine = [positions[0], positions[1], positions[3]];
    let view = View::default();
    assert!(matches!(render_surface(&Scene::new(&fine, &[]), &view), Err(RenderError::Empty { .. })));
    assert!(matches!(render_surface(&Scene::new(&positions, &[[0, 1, 3]]), &view), Err(RenderError::NonFinite { index: 2, .. })));
    assert!(matches!(render_surface(&Scene::new(&fine, &[[0, 1, 3]]), &view), Err(RenderError::IndexOutOfRange { index: 0, .. })));
    for (width, height) in [(0, 10), (10, 0), (9000, 10), (u32::MAX, u32::MAX)] {
        let sized = View { width, height, ..View::default() };
        assert!(matches!(render_surface(&Scene::new(&fine, &[[0, 1, 2]]), &sized), Err(RenderError::ImageSize { .. })));
    }
    let mut scene = Scene::new(&fine, &[[0, 1, 2]]);
    scene.colours = FaceColours::PerFace(&[]);
    assert!(matches!(render_surface(&scene, &view), Err(RenderError::LengthMismatch { .. })));
    let tilted = View { azimuth: f64::INFINITY, ..View::default() };
    assert!(matches!(render_surface(&Scene::new(&fine, &[[0, 1, 2]]), &tilted), Err(RenderError::BadParameter { .. })));
    let series = [Series { label: "x", values: &[0.5, f64::INFINITY], colour: RED }];
    assert!(matches!(render_histogram(&Histogram::of_quality("t", &series)), Err(RenderError::NonFinite { index: 1, .. })));
}

#[test]
fn huge_and_tiny_coordinates_are_drawn() {
    for size in [1e-300, 1e-9, 1e12, 1e300] {
        let positions = [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, 0.0]];
        let image = render_surface(&Scene::new(&positions, &[[0, 1, 2], [0, 1, 3]]), &from_above(100, 100)).expect("drawn");
        assert_ne!(image.pixel(35, 65), Some([255, 255, 255]), "{size}");
    }
}

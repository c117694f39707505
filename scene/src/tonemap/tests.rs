//! Tests of tone maps: what is black, white and grey, and what becomes of hues.

use super::*;

/// Luminances from 2⁻¹⁴ to 2¹⁴.
fn lights() -> impl Iterator<Item = f32> {
    (-1400..=1400).map(|i| (i as f32 / 100.0).exp2())
}

#[test]
fn every_rational_curve_shows_its_target() {
    for mapper in [ToneMapper::Aces, ToneMapper::Hable, ToneMapper::Reinhard] {
        let [shown, _, _] = mapper.shown([mapper.light_shown_as(0.85); 3]);
        assert!((shown - 0.85).abs() < 1e-5, "{mapper:?} {shown}");
        assert_eq!(mapper.shown([0.0; 3]), [0.0; 3]);
        assert!(mapper.shown([f32::MAX; 3])[0] > 0.99);
    }
    // Reinhard: x / (1 + x) = 0.85.
    assert!((ToneMapper::Reinhard.light_shown_as(0.85) - 0.85 / 0.15).abs() < 1e-5);
}

#[test]
fn every_map_grows_from_black_to_white_and_keeps_grey() {
    for (map, name) in ToneMap::ALL {
        assert_eq!(map.to_string(), name);
        assert_eq!(serde_json::to_value(map).unwrap(), name);
        let black = map.shown([0.0, -1.0, f32::NAN]);
        assert!(
            black.iter().all(|v| (0.0..1e-6).contains(v)),
            "{map}: {black:?}"
        );
        let mut before = 0.0;
        for light in lights() {
            let [r, g, b] = map.shown([light; 3]);
            assert!(
                (0.0..=1.0).contains(&r) && r + 1e-6 >= before,
                "{map} at {light}: {r}"
            );
            assert!(
                (r - g).abs() < 1e-4 && (r - b).abs() < 1e-4,
                "{map} at {light}"
            );
            before = r;
        }
        assert!(map.shown([f32::INFINITY; 3])[0] > 0.999, "{map}");
    }
}

#[test]
fn white_is_where_the_table_says() {
    for (map, white) in [
        (ToneMap::Srgb, 1.0),
        (ToneMap::Filmic, 5.6),
        (ToneMap::Aces, 12.1),
        (ToneMap::Agx, 16.3),
    ] {
        let [at, below] = [1.005, 0.97].map(|factor| map.shown([white * factor; 3])[0]);
        assert!(at > 0.9999 && below < 0.9999, "{map}: {below} {at}");
    }
    // Middle grey: 0.5^2.2 for AgX; by hand for ACES, x = 0.6·0.18: x(2.51x + 0.03) / (x(2.43x +
    // 0.59) + 0.14).
    assert!((ToneMap::Agx.shown([0.18; 3])[0] - 0.217_64).abs() < 1e-4);
    assert!((ToneMap::Aces.shown([0.18; 3])[0] - 0.140_12).abs() < 1e-4);
}

#[test]
fn hues_do_what_the_table_says() {
    // A bright orange: red : green is 4 : 1.
    let orange = [8.0, 2.0, 0.2];
    let shown = |map: ToneMap| map.shown(orange);
    assert_eq!(shown(ToneMap::Srgb), [1.0, 1.0, 0.2]);
    let [r, g, b] = ToneMap::Reinhard.shown([0.8, 0.2, 0.02]);
    assert!((r / g - 4.0).abs() < 1e-4 && (r / b - 40.0).abs() < 1e-3);
    // Blue, which srgb leaves alone, is lifted towards white by AgX.
    assert!(shown(ToneMap::Agx)[2] > 2.0 * shown(ToneMap::Srgb)[2]);
    for map in [ToneMap::Filmic, ToneMap::Aces, ToneMap::Agx] {
        let [r, g, b] = shown(map);
        assert!(r > g && g > b, "{map}: {:?}", [r, g, b]);
    }
}

#[test]
fn the_sigmoid_of_agx_is_steepest_at_grey_and_hits_both_ends() {
    let shown = |stops: f32| ToneMap::Agx.shown([0.18 * stops.exp2(); 3])[0].powf(1.0 / 2.2);
    assert!(shown(-10.0) < 1e-3 && shown(6.5) > 0.999);
    // Encoded values rise by 2 for a scale of 16.5 stops.
    let slope = (shown(0.1) - shown(-0.1)) / 0.2;
    assert!((slope - 2.0 / 16.5).abs() < 1e-3, "{slope}");
}

#[test]
fn the_meter_shows_the_geometric_mean_as_middle_grey() {
    let mut meter = ExposureMeter::default();
    assert_eq!(meter.stops(), 0.0);
    let picture =
        |values: [f32; 2]| Image::from_pixels(2, 1, values.map(|v| [v; 3]).to_vec()).unwrap();
    // Mean of logarithms: (0.09 · 1.44)^(1/2) = 0.36, one stop above 0.18; black does not count.
    meter.add(&picture([0.09, 1.44]));
    meter.add(&picture([0.0, f32::NAN]));
    assert!((meter.stops() + 1.0).abs() < 1e-6, "{}", meter.stops());
    let display = Display {
        stops: meter.stops(),
        tone_map: ToneMap::Srgb,
    };
    let shown = display.shown(&picture([0.36, 9.0]));
    assert!((shown.get(0, 0)[0] - 0.18).abs() < 1e-6);
    assert_eq!(shown.get(1, 0), [1.0; 3]);
}

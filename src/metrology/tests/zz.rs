mod truth;
use gnc_metrology::allan::*;
use truth::Dice;
use truth::noise::*;
#[test]
fn look() {
    let name = std::env::var("NAME").unwrap();
    let what = std::env::var("WHAT").unwrap_or_default();
    let s = SENSORS.iter().find(|s| s.name == name).unwrap();
    let mut dice = Dice::new(1);
    let mut shown = 0;
    for i in 0..300 {
        let v = s.record(&mut dice);
        let a = analyse(&v, Input::Rate, s.rate_hz, Kind::Oadev, &Taus::Octave, 1).unwrap();
        let c = a.coefficients;
        let show = match what.as_str() { "n" => c.n.is_err(), "b" => c.b.is_ok(), "k" => c.k.is_err(), "h" => !a.fit.as_ref().unwrap().holds, "r" => c.r.is_ok(), _ => true };
        if show && shown < 8 {
            shown += 1;
            println!("{i} {:?}\n N {:?}\n B {:?}\n K {:?} R {:?} Q {:?} bound {:?}", a.fit, c.n, c.b, c.k, c.r, c.q, c.b_upper_bound);
            println!("{:?}", a.points.iter().map(|p| (p.dev / s.square((p.tau_s * s.rate_hz).round() as usize).sqrt() * 1000.0).round() / 1000.0).collect::<Vec<_>>());
        }
    }
}
#[test]
fn gyro() {
    let (n_true, k_true, rate) = (0.002, 4e-4, 100.0_f64);
    for seed in 0..60 {
        let mut dice = Dice::new(100 + seed as u64);
        let mut walk = 0.0;
        let values: Vec<f64> = (0..200_000)
            .map(|_| {
                walk += k_true / rate.sqrt() * dice.normal();
                walk + n_true * rate.sqrt() * dice.normal()
            })
            .collect();
        let a = analyse(&values, Input::Rate, rate, Kind::Oadev, &Taus::Octave, 2).unwrap();
        let c = a.coefficients;
        if c.n.is_err() || c.k.is_err() || c.b.is_ok() || c.q.is_ok() { println!("{seed} {:?} {c:?}", a.fit); }
    }
}

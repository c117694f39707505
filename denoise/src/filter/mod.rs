//! own filter (experiment)
use crate::Frame;
use eagpt_scene::Image;
use glam::Vec3;
use rayon::prelude::*;

pub const F: usize = 8;
#[derive(Debug, Clone, Copy)]
pub struct Params {
    pub radius: i32, pub stride: usize, pub gather: i32,
    pub ridge: f32, pub sigma_n: f32, pub plane: f32, pub color: f32, pub color2: f32, pub relative: f32, pub passes: usize,
    pub clamp: f32, pub giveback: f32, pub spatial: f32, pub features: usize, pub varblur: i32,
}
impl Default for Params { fn default() -> Self { Self { radius: 8, stride: 1, gather: 1, ridge: 3e-3, sigma_n: 0.4, plane: 0.15, color: 2.0, color2: 2.0, relative: 0.02, passes: 2, clamp: 3.0, giveback: 1.0, spatial: 0.6, features: 6, varblur: 3 } } }

pub struct Work { pub w: i32, pub h: i32, pub incoming: Vec<Vec3>, pub var: Vec<f32>, pub normal: Vec<Vec3>, pub pos: Vec<Vec3>, pub cov: Vec<f32>, pub foot: Vec<f32>, pub alb: Vec<Vec3> }
fn lum(v: Vec3) -> f32 { v.dot(Vec3::new(0.2126, 0.7152, 0.0722)) }

impl Work {
    pub fn new(f: &Frame) -> Self {
        let (w, h) = f.reflected.size(); let (w, h) = (w as i32, h as i32); let n = (w*h) as usize;
        let mut incoming = vec![Vec3::ZERO; n]; let mut var = vec![0.0; n];
        let g = |i: &Image<3>| i.pixels().iter().map(|p| Vec3::from(*p)).collect::<Vec<_>>();
        let (normal, pos) = (g(&f.normal), g(&f.position));
        let cov: Vec<f32> = f.coverage.pixels().iter().map(|p| p[0]).collect();
        let alb = g(&f.albedo);
        for i in 0..n {
            let a = Vec3::from(f.albedo.pixels()[i]); let r = Vec3::from(f.reflected.pixels()[i]);
            let floor = 1e-3_f32.max(0.0);
            let m = r / a.max(Vec3::splat(floor));
            incoming[i] = if cov[i] > 0.0 { m } else { Vec3::ZERO };
            let ns = f.num_samples as f32 * cov[i];
            let l = lum(m);
            var[i] = if ns > 1.5 { ((f.second_moment.pixels()[i][0] - l*l).max(0.0)) / (ns - 1.0) } else { f.second_moment.pixels()[i][0] };
        }
        let mut foot = vec![0.0_f32; n];
        for y in 0..h { for x in 0..w { let i=(y*w+x) as usize; let mut m = f32::INFINITY;
            for (dx,dy) in [(1,0),(-1,0),(0,1),(0,-1)] { let (u,v)=(x+dx,y+dy); if u>=0&&v>=0&&u<w&&v<h { let j=(v*w+u) as usize; if cov[j]>0.0 { m=m.min(pos[i].distance(pos[j])); } } }
            foot[i]= if m.is_finite() { m } else { 0.0 };
        }}
        Self { w, h, incoming, var, normal, pos, cov, foot, alb }
    }
    fn idx(&self, x: i32, y: i32) -> usize { (y * self.w + x) as usize }
    fn guide(&self, i: usize, j: usize, p: &Params) -> f32 {
        // negative exponent
        let d = self.pos[j] - self.pos[i];
        let off = d.dot(self.normal[i]).abs();
        let dist = d.length();
        let pl = off / (p.plane * dist + self.foot[i] * 0.5 + 1e-20);
        let dn = self.normal[i] - self.normal[j];
        let nn = dn.length_squared() / (p.sigma_n * p.sigma_n);
        pl * pl + nn
    }
}
pub fn run(f: &Frame, p: &Params) -> Image<3> {
    let w = Work::new(f);
    let n = w.incoming.len();
    // variance smoothed
    let var = blur_var(&w, p);
    let (mut clean, _) = despeckle(&w, &w.incoming, &var, p);
    let mut est: Option<Vec<Vec3>> = None;
    let mut evar = var.clone();
    for pass in 0..p.passes {
        let e = regress(&w, &clean, est.as_deref(), &evar, p, if pass <= 1 { p.color } else { p.color2 });
        // winsorise against the estimate
        if p.clamp > 0.0 {
            clean = (0..n).map(|i| {
                let (l, m) = (lum(w.incoming[i]), lum(e[i]).max(0.0));
                let cap = m + p.clamp * var[i].sqrt();
                if l > cap && l > 0.0 { w.incoming[i] * (cap / l) } else { w.incoming[i] }
            }).collect();
        }
        evar = var.iter().map(|v| v * 0.05).collect();
        est = Some(e);
    }
    let mut out = est.unwrap_or_else(|| clean.clone());
    if p.giveback > 0.0 {
        let excess: Vec<Vec3> = (0..n).map(|i| w.incoming[i] - clean[i]).collect();
        let wide = wide(&w, &excess, p);
        for i in 0..n { out[i] += wide[i] * p.giveback; }
    }
    let refl = (0..n).map(|i| (out[i].max(Vec3::ZERO) * w.alb[i]).to_array()).collect();
    Image::from_pixels(w.w as u32, w.h as u32, refl).unwrap()
}
pub fn reflected(f: &Frame) -> Image<3> { run(f, &Params::default()) }
fn par<T: Send, G: Fn(i32, i32) -> T + Sync>(w: &Work, g: G) -> Vec<T> {
    (0..(w.w*w.h)).into_par_iter().with_min_len(64).map(|i| g(i % w.w, i / w.w)).collect()
}
fn blur_var(w: &Work, p: &Params) -> Vec<f32> {
    let r = p.varblur;
    par(w, |x, y| { let i = w.idx(x, y); let (mut s, mut t) = (1e-12, 0.0);
        for v in (y-r).max(0)..=(y+r).min(w.h-1) { for u in (x-r).max(0)..=(x+r).min(w.w-1) { let j = w.idx(u,v); if w.cov[j] <= 0.0 { continue; }
            let k = (-w.guide(i,j,p)).exp(); s += k; t += k * w.var[j].sqrt(); } }
        (t / s).powi(2) })
}
fn despeckle(w: &Work, c: &[Vec3], _var: &[f32], p: &Params) -> (Vec<Vec3>, ()) {
    let r = 3;
    (par(w, |x, y| { let i = w.idx(x, y); let (mut s, mut t, mut t2) = (1e-12, 0.0, 0.0);
        for v in (y-r).max(0)..=(y+r).min(w.h-1) { for u in (x-r).max(0)..=(x+r).min(w.w-1) { let j = w.idx(u,v); if j == i || w.cov[j] <= 0.0 { continue; }
            let k = (-w.guide(i,j,p)).exp(); let l = lum(c[j]).max(0.0).sqrt(); s += k; t += k * l; t2 += k * l * l; } }
        if s < 0.5 { return c[i]; }
        let m = t / s; let sd = (t2 / s - m * m).max(0.0).sqrt(); let cap = (m + 2.0 * sd).powi(2); let l = lum(c[i]);
        if l > cap { c[i] * (cap / l) } else { c[i] } }), ())
}
fn wide(w: &Work, e: &[Vec3], p: &Params) -> Vec<Vec3> {
    let mut cur = e.to_vec();
    for level in 0..5 { let st = 1 << level;
        let k1 = [0.0625, 0.25, 0.375, 0.25, 0.0625];
        cur = par(w, |x, y| { let i = w.idx(x, y); let (mut s, mut t) = (1e-12_f32, Vec3::ZERO);
            for b in -2..=2 { for a in -2..=2 { let (u, v) = (x + a*st, y + b*st); if u<0||v<0||u>=w.w||v>=w.h { continue; } let j = w.idx(u,v); if w.cov[j] <= 0.0 { continue; }
                let k = k1[(a+2) as usize]*k1[(b+2) as usize]*(-w.guide(i,j,p)).exp(); s += k; t += cur[j]*k; } }
            t / s });
    }
    cur
}
fn feat(w: &Work, p: &Params, i: usize, j: usize, dx: i32, dy: i32) -> [f32; F] {
    let inv = 1.0 / p.radius as f32;
    let dn = w.normal[j] - w.normal[i];
    let mut f = [1.0, dx as f32 * inv, dy as f32 * inv, dn.x, dn.y, dn.z, 0.0, 0.0];
    if p.features > 6 { let d = w.pos[j]-w.pos[i]; f[6] = d.dot(w.normal[i]) / (w.foot[i] * p.radius as f32 + 1e-20); }
    for k in p.features..F { f[k] = 0.0; }
    f
}
fn regress(w: &Work, c: &[Vec3], est: Option<&[Vec3]>, evar: &[f32], p: &Params, kc: f32) -> Vec<Vec3> {
    let r = p.radius;
    let st = p.stride as i32;
    let (gw, gh) = ((w.w + st - 1) / st, (w.h + st - 1) / st);
    let inv2 = 1.0 / (p.spatial * r as f32).powi(2);
    let weight = |i: usize, j: usize, dx: i32, dy: i32| -> f32 {
        let mut e = w.guide(i, j, p) + (dx*dx + dy*dy) as f32 * inv2 * 0.5;
        if let Some(est) = est {
            let d = est[i] - est[j]; let l = lum(est[i]).max(lum(est[j]));
            e += d.length_squared() / (kc * kc * (evar[i] + evar[j]) + (p.relative * l).powi(2) + 1e-12);
        }
        if e > 12.0 { 0.0 } else { w.cov[j] * (-e).exp() }
    };
    let coefs: Vec<[Vec3; F]> = (0..gw * gh).into_par_iter().with_min_len(16).map(|g| {
        let (x, y) = (g % gw * st, g / gw * st); let i = w.idx(x, y);
        let mut m = [[0.0_f32; F]; F]; let mut b = [Vec3::ZERO; F];
        if w.cov[i] <= 0.0 { return b; }
        for v in (y-r).max(0)..=(y+r).min(w.h-1) { for u in (x-r).max(0)..=(x+r).min(w.w-1) {
            let j = w.idx(u, v); if w.cov[j] <= 0.0 { continue; }
            let k = weight(i, j, u-x, v-y); if k == 0.0 { continue; }
            let f = feat(w, p, i, j, u-x, v-y);
            for s in 0..F { let ks = k * f[s]; for t in 0..F { m[s][t] += ks * f[t]; } b[s] += c[j] * ks; }
        } }
        let total = m[0][0];
        for s in 0..F { m[s][s] += if s == 0 { 1e-6 * total } else { p.ridge * total + 1e-3 } ; }
        solve(&m, &b)
    }).collect();
    let gr = p.gather;
    par(w, |x, y| { let j = w.idx(x, y); if w.cov[j] <= 0.0 { return Vec3::ZERO; }
        if st == 1 && gr == 0 { return coefs[j][0]; }
        let (mut s, mut t) = (0.0_f32, Vec3::ZERO);
        for gy in ((y - gr + st - 1).max(0) / st)..=((y + gr) / st).min(gh - 1) { for gx in ((x - gr + st - 1).max(0) / st)..=((x + gr) / st).min(gw - 1) {
            let (cx, cy) = (gx * st, gy * st); let i = w.idx(cx, cy); if w.cov[i] <= 0.0 { continue; }
            let k = weight(i, j, x - cx, y - cy).max(1e-6);
            let f = feat(w, p, i, j, x - cx, y - cy); let co = &coefs[(gy * gw + gx) as usize];
            let mut q = Vec3::ZERO; for a in 0..F { q += co[a] * f[a]; }
            s += k; t += q.max(Vec3::ZERO) * k; } }
        if s > 0.0 { t / s } else { c[j] } })
}
fn solve(m: &[[f32; F]; F], b: &[Vec3; F]) -> [Vec3; F] {
    let mut l = [[0.0_f32; F]; F];
    for i in 0..F { for j in 0..=i { let mut s = m[i][j]; for k in 0..j { s -= l[i][k]*l[j][k]; }
        if i == j { l[i][i] = s.max(1e-12).sqrt(); } else { l[i][j] = s / l[j][j]; } } }
    let mut y = *b; for i in 0..F { for k in 0..i { let t = y[k]*l[i][k]; y[i] -= t; } y[i] /= l[i][i]; }
    for i in (0..F).rev() { for k in i+1..F { let t = y[k]*l[k][i]; y[i] -= t; } y[i] /= l[i][i]; }
    y
}

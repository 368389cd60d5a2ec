//! Vectors and matrices as JSON.

use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

pub(super) fn vector(v: &Vector3<f64>) -> Value {
    json!([v[0], v[1], v[2]])
}

pub(super) fn matrix(m: &Matrix3<f64>) -> Value {
    json!(rows(m))
}

pub(super) fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)]])
}

pub(super) fn of_rows(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

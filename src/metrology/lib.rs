//! Calibration, Allan variance, ellipse correction, statistics and uncertainty.

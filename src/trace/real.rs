//! Arithmetic that is the same for one ray and for many side by side: formulas are written once over [`Real`].

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use glam::Vec3;

/// A number, or one a lane.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// What comparing gives.
    type Choice: Choice<Self>;

    /// `value` in all lanes; `self` lends what else it takes.
    fn all(self, value: f32) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The lesser of both.
    fn min(self, other: Self) -> Self;
    /// The greater of both.
    fn max(self, other: Self) -> Self;
    /// Where `self` is less than `other`.
    fn lt(self, other: Self) -> Self::Choice;
    /// Power with an exponent of at least 0; what is below 0 counts as 0.
    fn power(self, exponent: f32) -> Self;
}

/// Whether, or whether a lane.
pub trait Choice<R>: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Whether it is so in any lane.
    fn any(self) -> bool;
    /// `yes` where it is so, `no` elsewhere.
    fn select(self, yes: R, no: R) -> R;
}

impl Real for f32 {
    type Choice = bool;

    #[inline(always)]
    fn all(self, value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        f32::min(self, other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        f32::max(self, other)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn power(self, exponent: f32) -> Self {
        f32::max(self, 0.0).powf(exponent)
    }
}

impl Choice<f32> for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn select(self, yes: f32, no: f32) -> f32 {
        if self { yes } else { no }
    }
}

/// A vector, a colour, or one a lane.
#[derive(Debug, Clone, Copy)]
pub struct Triple<R> {
    /// Or red.
    pub x: R,
    /// Or green.
    pub y: R,
    /// Or blue.
    pub z: R,
}

impl<R: Real> Triple<R> {
    /// `value` in all lanes of `like`.
    #[inline(always)]
    pub fn all(like: R, value: Vec3) -> Self {
        Self { x: like.all(value.x), y: like.all(value.y), z: like.all(value.z) }
    }

    /// Dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> R {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Scaled to length 1.
    #[inline(always)]
    pub fn unit(self) -> Self {
        self * (self.x.all(1.0) / self.dot(self).sqrt())
    }

    /// Product, component by component.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }

    /// The greatest component.
    #[inline(always)]
    pub fn greatest(self) -> R {
        self.x.max(self.y).max(self.z)
    }

    /// `self` where `choice`, `other` elsewhere.
    #[inline(always)]
    pub fn where_else(self, choice: R::Choice, other: Self) -> Self {
        Self {
            x: choice.select(self.x, other.x),
            y: choice.select(self.y, other.y),
            z: choice.select(self.z, other.z),
        }
    }
}

impl From<Vec3> for Triple<f32> {
    #[inline(always)]
    fn from(Vec3 { x, y, z }: Vec3) -> Self {
        Self { x, y, z }
    }
}

impl From<Triple<f32>> for Vec3 {
    #[inline(always)]
    fn from(Triple { x, y, z }: Triple<f32>) -> Self {
        Self { x, y, z }
    }
}

impl<R: Real> Add for Triple<R> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<R: Real> Sub for Triple<R> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<R: Real> Mul<R> for Triple<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: R) -> Self {
        Self { x: self.x * by, y: self.y * by, z: self.z * by }
    }
}

impl<R: Real> Neg for Triple<R> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

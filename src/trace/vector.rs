//! Numbers of sixteen rays side by side, in one vector where the processor has AVX-512, in two where it has AVX2.
//!
//! All of it is inlined into code that is compiled for that processor; the body of a closure is not, so there are none.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use glam::Vec3;
use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::x86::{V3, V3_512b, V4};

use super::real::{Choice, Real, Triple};

/// Numbers in a vector.
pub(super) const WIDTH: usize = 16;

/// An instruction set with vectors of [`WIDTH`] numbers.
pub(super) trait Isa: Simd {
    /// A bit for each lane that is set.
    fn bits(self, mask: Self::m32s) -> u16;
}

/// What can be done with any of them.
pub(super) trait Work {
    /// Does it; always inlined.
    fn run<S: Isa>(self, simd: S);
}

/// A processor that is worth it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Processor {
    /// One with AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512(V4),
    /// One with AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2(V3),
}

impl Processor {
    /// What this one may be used as, the best first; nothing where rays are better looked at one by one.
    pub fn all() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        return V4::try_new().map(Self::Avx512).into_iter().chain(V3::try_new().map(Self::Avx2)).collect();
        #[cfg(not(target_arch = "x86_64"))]
        Vec::new()
    }

    /// Does `work`, compiled for it.
    #[cfg_attr(not(target_arch = "x86_64"), allow(unused_variables))]
    pub fn run(self, work: impl Work) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => simd.vectorize(On(simd, work)),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => simd.vectorize(On(V3_512b(simd), work)),
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl Isa for V4 {
    #[inline(always)]
    fn bits(self, mask: Self::m32s) -> u16 {
        mask.0
    }
}

#[cfg(target_arch = "x86_64")]
impl Isa for V3_512b {
    #[inline(always)]
    fn bits(self, mask: Self::m32s) -> u16 {
        let [low, high] = pulp::cast(mask);
        let avx = self.0.avx;
        avx._mm256_movemask_ps(low) as u16 | (avx._mm256_movemask_ps(high) as u16) << 8
    }
}

#[cfg(target_arch = "x86_64")]
struct On<S, W>(S, W);

#[cfg(target_arch = "x86_64")]
impl<S: Isa, W: Work> pulp::NullaryFnOnce for On<S, W> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.1.run(self.0);
    }
}

/// A number a lane.
pub(super) struct Numbers<S: Isa>(S, S::f32s);

/// Whether, a lane.
pub(super) struct Mask<S: Isa>(S, S::m32s);

impl<S: Isa> Clone for Numbers<S> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Isa> Copy for Numbers<S> {}

impl<S: Isa> Clone for Mask<S> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Isa> Copy for Mask<S> {}

impl<S: Isa> Numbers<S> {
    /// `value` in all lanes.
    #[inline(always)]
    pub fn splat(simd: S, value: f32) -> Self {
        Self(simd, simd.splat_f32s(value))
    }

    /// A value a lane.
    #[inline(always)]
    pub fn load(simd: S, values: &[f32; WIDTH]) -> Self {
        Self(simd, S::as_simd_f32s(values).0[0])
    }

    /// The values.
    #[inline(always)]
    pub fn store(self) -> [f32; WIDTH] {
        let mut values = [0.0; WIDTH];
        S::as_mut_simd_f32s(&mut values).0[0] = self.1;
        values
    }

    #[inline(always)]
    pub fn le(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_or_equal_f32s(self.1, other.1))
    }

    #[inline(always)]
    pub fn equals(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.equal_f32s(self.1, other.1))
    }

    /// The instruction set.
    #[inline(always)]
    pub fn simd(self) -> S {
        self.0
    }

    #[inline(always)]
    pub fn abs(self) -> Self {
        let magnitude = self.0.splat_u32s(u32::MAX >> 1);
        Self(self.0, pulp::cast(self.0.and_u32s(pulp::cast(self.1), magnitude)))
    }

    /// Its own size, the sign of `other`.
    #[inline(always)]
    pub fn copysign(self, other: Self) -> Self {
        let simd = self.0;
        let sign = simd.and_u32s(pulp::cast(other.1), simd.splat_u32s(1 << 31));
        Self(simd, pulp::cast(simd.or_u32s(pulp::cast(self.abs().1), sign)))
    }

    /// The least of all lanes.
    #[inline(always)]
    pub fn least(self) -> f32 {
        self.0.reduce_min_f32s(self.1)
    }

    /// The greatest of all lanes.
    #[inline(always)]
    pub fn greatest(self) -> f32 {
        self.0.reduce_max_f32s(self.1)
    }
}

impl<S: Isa> Mask<S> {
    #[inline(always)]
    pub fn new(simd: S, mask: S::m32s) -> Self {
        Self(simd, mask)
    }

    #[inline(always)]
    pub fn simd(self) -> S {
        self.0
    }

    /// Set in the lanes whose bit is.
    #[inline(always)]
    pub fn from_bits(simd: S, bits: u16) -> Self {
        let mut lanes = [0; WIDTH];
        for (lane, value) in lanes.iter_mut().enumerate() {
            *value = u32::from(bits >> lane & 1);
        }
        Self(simd, simd.less_than_u32s(simd.splat_u32s(0), S::as_simd_u32s(&lanes).0[0]))
    }

    /// A bit for each lane that is set.
    #[inline(always)]
    pub fn bits(self) -> u16 {
        self.0.bits(self.1)
    }

    /// The same of whole numbers.
    #[inline(always)]
    pub fn select_whole(self, yes: S::u32s, no: S::u32s) -> S::u32s {
        self.0.select_u32s(self.1, yes, no)
    }
}

impl<S: Isa> Real for Numbers<S> {
    type Choice = Mask<S>;

    #[inline(always)]
    fn all(self, value: f32) -> Self {
        Self::splat(self.0, value)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt_f32s(self.1))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min_f32s(self.1, other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0, self.0.max_f32s(self.1, other.1))
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_f32s(self.1, other.1))
    }

    #[inline(always)]
    fn power(self, exponent: f32) -> Self {
        let mut values = self.store();
        for value in &mut values {
            *value = value.power(exponent);
        }
        Self::load(self.0, &values)
    }
}

impl<S: Isa> Choice<Numbers<S>> for Mask<S> {
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }

    #[inline(always)]
    fn select(self, yes: Numbers<S>, no: Numbers<S>) -> Numbers<S> {
        let Self(simd, mask) = self;
        Numbers(simd, pulp::cast(simd.select_u32s(mask, pulp::cast(yes.1), pulp::cast(no.1))))
    }
}

/// A vector a lane, component by component.
pub(super) type Lanes3 = [[f32; WIDTH]; 3];

/// Sets the vector of a lane.
#[inline(always)]
pub(super) fn put(lanes: &mut Lanes3, lane: usize, value: Vec3) {
    lanes[0][lane] = value.x;
    lanes[1][lane] = value.y;
    lanes[2][lane] = value.z;
}

/// The vector of a lane.
#[inline(always)]
pub(super) fn get(lanes: &Lanes3, lane: usize) -> Vec3 {
    Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane])
}

impl<S: Isa> Triple<Numbers<S>> {
    /// A vector a lane.
    #[inline(always)]
    pub fn load(simd: S, [x, y, z]: &Lanes3) -> Self {
        Self { x: Numbers::load(simd, x), y: Numbers::load(simd, y), z: Numbers::load(simd, z) }
    }

    /// The vectors.
    #[inline(always)]
    pub fn store(self) -> Lanes3 {
        [self.x.store(), self.y.store(), self.z.store()]
    }
}

macro_rules! operator {
    ($of:ident, $name:ident, $function:ident, $does:ident) => {
        impl<S: Isa> $name for $of<S> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0, self.0.$does(self.1, other.1))
            }
        }
    };
}

operator!(Numbers, Add, add, add_f32s);
operator!(Numbers, Sub, sub, sub_f32s);
operator!(Numbers, Mul, mul, mul_f32s);
operator!(Numbers, Div, div, div_f32s);
operator!(Mask, BitAnd, bitand, and_m32s);
operator!(Mask, BitOr, bitor, or_m32s);

impl<S: Isa> Neg for Numbers<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0, self.0.neg_f32s(self.1))
    }
}

impl<S: Isa> Not for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0, self.0.not_m32s(self.1))
    }
}

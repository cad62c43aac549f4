// SPDX-License-Identifier: BSD-3-Clause
// Included inside a class of Eigen's, from arm_neon.h beside it. Where this is defined the kernel of large products
// works on blocks of six rows instead of four, and triangular solvers add in another order.
#undef EIGEN_HAS_SINGLE_INSTRUCTION_MADD

// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Included before all else by compilers that lack the builtin (GCC before 12): theirs takes the places as
// a vector of integers as wide as the numbers, the type that a comparison gives.
#define __builtin_shufflevector(a, b, ...) \
  __builtin_shuffle(a, b, __typeof__((a) < (b)){__VA_ARGS__})

// Vectors of lanes: each lane computes for a ray of its own, all by the same instructions.
//
// These are clang's own vectors: `a + b`, `a < b`, `-a` apply to each lane, and a number beside lanes is used in all.
// The result in a lane depends neither on the number of lanes nor on the other lanes. The build sets LANES: 16 with
// AVX-512, 8 with AVX2, 4 otherwise.
#pragma once
#include "base/arrays.h"
#if defined(__AVX2__)
#include <immintrin.h>
#endif

// Lanes are passed in registers only if calls are inlined, so all functions that take them are INLINE.

template <class T, int NUM>
using Vector = T __attribute__((ext_vector_type(NUM)));

using Floats = Vector<float, LANES>;
using Ints = Vector<int32_t, LANES>;
using Mask = Vector<bool, LANES>;

// Operations that clang's vectors lack, or define in another way than is needed here.

// Return a mask with one bit for each lane, from a comparison of vectors, which gives 0 or -1 as an integer in each
// lane.
template <class V>
INLINE auto mask_of(V compared) { return __builtin_convertvector(compared, Vector<bool, __builtin_vectorelements(V)>); }

template <int NUM>
INLINE bool any_of(Vector<bool, NUM> mask) { return __builtin_reduce_or(mask); }

template <int NUM, class T>
INLINE Vector<T, NUM> where(Vector<bool, NUM> mask, Vector<T, NUM> a, Vector<T, NUM> b) { return mask ? a : b; }

// Return a vector with a number in all lanes.
template <class V, class T>
INLINE V in_all(T number) { return (V)number; }

// Return the larger number in each lane. As in Python, it is `a` if both are equal, or if one of them is NaN.
template <class V>
INLINE V max_of(V a, V b) { return where(mask_of(b > a), b, a); }

// Return the smaller number in each lane. As in Python, it is `a` if both are equal, or if one of them is NaN.

template <class V>
INLINE V min_of(V a, V b) { return where(mask_of(b < a), b, a); }

// Return x * y + z, rounded once.
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
template <class V>
INLINE V fused(V x, V y, V z) { return __builtin_elementwise_fma(x, y, z); }
#else
// Return x * y + z for float32, by float64. In float64 the product is exact. The sum is rounded to odd: unless it is
// exact, to the neighbour whose last bit is 1. Rounding that sum to float32 gives the result of a single rounding.
template <int NUM>
INLINE Vector<float, NUM> fused(Vector<float, NUM> x, Vector<float, NUM> y, Vector<float, NUM> z) {
    using Doubles = Vector<double, NUM>;
    using Longs = Vector<int64_t, NUM>;
    Doubles product = __builtin_convertvector(x, Doubles) * __builtin_convertvector(y, Doubles);
    Doubles addend = __builtin_convertvector(z, Doubles), sum = product + addend;
    Doubles of_product = sum - addend, error = (product - of_product) + (addend - (sum - of_product));
    Longs bits;
    __builtin_memcpy(&bits, &sum, sizeof bits);
    Longs is_inexact = (Longs)((error < 0.0) | (error > 0.0));
    Longs towards = (Longs)((error > 0.0) ^ (sum > 0.0)) | 1;  // 1 moves the sum away from 0, -1 towards 0
    bits += is_inexact & ~(-(bits & 1)) & towards;
    __builtin_memcpy(&sum, &bits, sizeof sum);
    return __builtin_convertvector(sum, Vector<float, NUM>);
}
#endif
INLINE Floats fma(Floats x, Floats y, Floats z) { return fused(x, y, z); }

template <class V>
INLINE V root(V x) { return __builtin_elementwise_sqrt(x); }

template <class V>
INLINE V magnitude(V x) { return __builtin_elementwise_abs(x); }

INLINE Ints to_int32(Floats x) {  // rounds towards 0
    return __builtin_convertvector(x, Ints);
}

INLINE Floats to_float32(Ints x) { return __builtin_convertvector(x, Floats); }

INLINE Floats bits_to_float32(Ints x) { return __builtin_bit_cast(Floats, x); }

INLINE Ints float32_to_bits(Floats x) { return __builtin_bit_cast(Ints, x); }

// Lists of lane numbers, for shuffles.

template <int... LANE>
struct Lanes {};

template <class T, T... LANE>
struct Counted {
    using Type = Lanes<LANE...>;
};
template <int NUM>
using UpTo = typename __make_integer_seq<Counted, int, NUM>::Type;

template <class V, int... LANE>
INLINE auto shuffle(V one, V other, Lanes<LANE...>) { return __builtin_shufflevector(one, other, LANE...); }

template <class V, int... LANE>
INLINE V numbers_of(Lanes<LANE...>) { return V{LANE...}; }

template <class V>
INLINE V lane_numbers() { return numbers_of<V>(UpTo<__builtin_vectorelements(V)>()); }

template <class V>
INLINE auto join(V one, V other) { return shuffle(one, other, UpTo<2 * __builtin_vectorelements(V)>()); }

// Loads and stores. A `place` is the index of an element. In an Array, a checked build traps if an element is out of
// bounds; behind a pointer, nothing checks places.

template <class V, class T>
INLINE V load(const T* base, int64_t place) {
    V lanes;
    __builtin_memcpy(&lanes, base + place, sizeof lanes);
    return lanes;
}

template <class V, class T>
INLINE void store(T* base, int64_t place, V lanes) { __builtin_memcpy(base + place, &lanes, sizeof lanes); }

// Return the address of an array, after a check that it has NUM elements from a place on.
template <int NUM, class T>
INLINE T* checked(const Array<T, 1>& array, int64_t place) {
    Array<T, 1>::checked(place, array.shape[0]);
    Array<T, 1>::checked(place + NUM - 1, array.shape[0]);
    return array.data;
}

template <class V, class T>
INLINE V load(const Array<T, 1>& array, int64_t place) {
    return load<V>(checked<__builtin_vectorelements(V)>(array, place), place);
}

template <class V, class T>
INLINE void store(const Array<T, 1>& array, int64_t place, V lanes) {
    store(checked<__builtin_vectorelements(V)>(array, place), place, lanes);
}

INLINE int64_t address(Ints places, int lane) { return (uint32_t)places[lane]; }

// Join NUM rows into one vector: the rows with the numbers FIRST, FIRST + STEP, ..., each loaded by `load_row(number)`.
template <int FIRST, int STEP, int NUM, class LoadRow>
INLINE auto joined_rows(const LoadRow& load_row) {
    if constexpr (NUM == 1) {
        return load_row(FIRST);
    } else {
        return join(joined_rows<FIRST, STEP, NUM / 2>(load_row),
                    joined_rows<FIRST + STEP * NUM / 2, STEP, NUM / 2>(load_row));
    }
}

template <class V>
struct Four {
    V a, b, c, d;
};

// Return a vector that is shuffled from two vectors, each group of four lanes alike. A, B, C, D: the lanes that a group
// of the result takes from the groups at the same place in both vectors; 0 to 3 are lanes of the first vector's group,
// 4 to 7 lanes of the second vector's group.
template <int A, int B, int C, int D, class V, int... LANE>
INLINE V interleave(V one, V other, Lanes<LANE...>) {
    constexpr int num = sizeof...(LANE), picked[4] = {A, B, C, D};
    return __builtin_shufflevector(
        one, other, (LANE / 4 * 4 + picked[LANE % 4] % 4 + (picked[LANE % 4] >= 4 ? num : 0))...);
}

// Transpose four vectors: in each group of four lanes, the 4 x 4 elements are transposed.
template <class V>
INLINE Four<V> transpose(V a, V b, V c, V d) {
    UpTo<__builtin_vectorelements(V)> lanes;
    V low = interleave<0, 4, 1, 5>(a, b, lanes), next_low = interleave<0, 4, 1, 5>(c, d, lanes);
    V high = interleave<2, 6, 3, 7>(a, b, lanes), next_high = interleave<2, 6, 3, 7>(c, d, lanes);
    return {
        interleave<0, 1, 4, 5>(low, next_low, lanes),
        interleave<2, 3, 6, 7>(low, next_low, lanes),
        interleave<0, 1, 4, 5>(high, next_high, lanes),
        interleave<2, 3, 6, 7>(high, next_high, lanes),
    };
}

// Load LANES rows of four elements, and return four vectors: the first elements of all rows, the second, and so on.
template <class LoadRow>
INLINE auto columns_of(const LoadRow& load_row) {
    constexpr int fours = LANES / 4;
    return transpose(joined_rows<0, 4, fours>(load_row), joined_rows<1, 4, fours>(load_row),
                     joined_rows<2, 4, fours>(load_row), joined_rows<3, 4, fours>(load_row));
}

// Return, for each lane, the element of an array at the lane's place and the three elements after it, as four vectors.
// Base: an Array or a pointer, here and below.
template <class Base>
INLINE auto load_four(const Base& array, Ints places) {
    using T = __remove_cvref(decltype(array[0]));
    return columns_of([&](int lane) { return load<Vector<T, 4>>(array, address(places, lane)); });
}

// For each lane, write the element of an array at the lane's place to `first`, and the element after it to `second`.
// Gather instructions would take a quarter longer, on a Zen 4.
template <class Base>
INLINE void load_pairs(const Base& array, Ints places, Floats& first, Floats& second) {
    auto load_two = [&](int lane) {
        return join(load<Vector<float, 2>>(array, address(places, lane)),
                    load<Vector<float, 2>>(array, address(places, lane + 1)));
    };
    Floats one = joined_rows<0, 4, LANES / 4>(load_two), other = joined_rows<2, 4, LANES / 4>(load_two);
    first = interleave<0, 2, 4, 6>(one, other, UpTo<LANES>());
    second = interleave<1, 3, 5, 7>(one, other, UpTo<LANES>());
}

// Return the four numbers (a, b, c, d) of one lane, from the result of `transpose(a, b, c, d)`, where they are side by
// side.
template <int LANE, class V>
INLINE auto row_of(const Four<V>& transposed) {
    constexpr int number = LANE % 4;
    const auto& [a, b, c, d] = transposed;
    const V& lanes = number == 0 ? a : number == 1 ? b : number == 2 ? c : d;
    constexpr int first = LANE / 4 * 4;
    return shuffle(lanes, lanes, Lanes<first, first + 1, first + 2, first + 3>());
}

template <class Base>
INLINE auto gather(const Base& array, Ints places) {
    Vector<__remove_cvref(decltype(array[0])), LANES> lanes;
#pragma clang loop unroll(full)
    for (int lane = 0; lane < LANES; lane++) lanes[lane] = array[address(places, lane)];
    return lanes;
}

// Return, in each lane, the lane of `table` whose number is in `at`, by instructions that the compiler does not find
// itself.
INLINE Floats permute(Floats table, Ints at) {
#if LANES == 16 && defined(__AVX512F__)
    return __builtin_bit_cast(
        Floats, _mm512_permutexvar_ps(__builtin_bit_cast(__m512i, at), __builtin_bit_cast(__m512, table)));
#elif LANES == 8 && defined(__AVX2__)
    return __builtin_bit_cast(
        Floats, _mm256_permutevar8x32_ps(__builtin_bit_cast(__m256, table), __builtin_bit_cast(__m256i, at)));
#else
    Floats lanes;
#pragma clang loop unroll(full)
    for (int lane = 0; lane < LANES; lane++) lanes[lane] = table[at[lane]];
    return lanes;
#endif
}

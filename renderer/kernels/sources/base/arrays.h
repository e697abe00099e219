// Arrays of numpy, as kernels take them: contiguous, in C order, at any address (x86-64 and aarch64 read unaligned
// numbers). Buffers are memory that a kernel takes for itself.
#pragma once
#include <stdint.h>

#define INLINE inline __attribute__((always_inline))

constexpr double INFINITE = __builtin_inf();

// The result of a kernel. Python raises MemoryError, IndexError or KeyboardInterrupt for the last three.
enum Status : int32_t { DONE = 0, NO_MEMORY = 1, OUT_OF_BOUNDS = 2, STOPPED = 3 };

// A contiguous array in C order, of which `array(z, y, x)` is an element. A checked build traps if an index is out of
// bounds; other builds check nothing.
template <class T, int DIMENSIONS>
struct Array {
    T* data;
    int64_t shape[DIMENSIONS];

    template <class... Index>
    INLINE T& operator()(Index... index) const {
        static_assert(sizeof...(Index) == DIMENSIONS);
        int64_t place = 0;
        int axis = 0;
        ((place = place * shape[axis] + checked((int64_t)index, shape[axis]), axis++), ...);
        return data[place];
    }

    // Return the part of the array at one first index: a row of a matrix, or a plane of a volume.
    INLINE Array<T, DIMENSIONS - 1> operator[](int64_t index) const
        requires(DIMENSIONS > 1)
    {
        Array<T, DIMENSIONS - 1> rest;
        int64_t size = 1;
        for (int axis = 1; axis < DIMENSIONS; axis++) rest.shape[axis - 1] = shape[axis], size *= shape[axis];
        rest.data = data + checked(index, shape[0]) * size;
        return rest;
    }

    INLINE T& operator[](int64_t index) const
        requires(DIMENSIONS == 1)
    {
        return data[checked(index, shape[0])];
    }

    INLINE int64_t size() const {
        int64_t product = 1;
        for (int64_t one : shape) product *= one;
        return product;
    }

    static INLINE int64_t checked(int64_t index, [[maybe_unused]] int64_t end) {
#ifdef CHECKED
        if (index < 0 || index >= end) __builtin_trap();
#endif
        return index;
    }
};

// Return the elements of an array from a position on.
template <class T>
INLINE Array<T, 1> rest_of(const Array<T, 1>& array, int64_t place) {
    return {array.data + Array<T, 1>::checked(place, array.shape[0] + 1), {array.shape[0] - place}};
}

// An Array whose last sizes are fixed, as in [n, 3]. Python checks them before the kernel runs.
template <class T, int DIMENSIONS, int64_t...>
using Sized = Array<T, DIMENSIONS>;

template <class T, int DIMENSIONS, class... Sizes>
INLINE bool has_shape(const Array<T, DIMENSIONS>& array, Sizes... sizes) {
    static_assert(sizeof...(Sizes) == DIMENSIONS);
    int axis = 0;
    return ((array.shape[axis++] == sizes) && ...);
}

// A read-only array of any dtype. dtype: the number of the dtype, as in `with_array`.
template <int DIMENSIONS>
struct AnyArray {
    const void* data;
    int64_t shape[DIMENSIONS];
    int64_t dtype;
};

// A value that may be missing: None in Python.
template <class T>
struct Maybe {
    bool exists;
    T value;
};

// Call a generic lambda with an array of any dtype as an Array of its element type. The number of a dtype is its
// position in DTYPES in header.py.
template <int DIMENSIONS, class Function>
INLINE Status with_array(const AnyArray<DIMENSIONS>& any, Function function) {
    auto call = [&]<class T>(const T* data) {
        Array<const T, DIMENSIONS> array = {data, {}};
        for (int axis = 0; axis < DIMENSIONS; axis++) array.shape[axis] = any.shape[axis];
        return function(array);
    };
    switch (any.dtype) {
        case 0: return call((const uint8_t*)any.data);
        case 1: return call((const int8_t*)any.data);
        case 2: return call((const uint16_t*)any.data);
        case 3: return call((const int16_t*)any.data);
        case 4: return call((const uint32_t*)any.data);
        case 5: return call((const int32_t*)any.data);
        case 6: return call((const uint64_t*)any.data);
        case 7: return call((const int64_t*)any.data);
        case 8: return call((const float*)any.data);
        case 9: return call((const double*)any.data);
        default: return OUT_OF_BOUNDS;
    }
}

extern "C" void* calloc(__SIZE_TYPE__ num, __SIZE_TYPE__ size) noexcept;
extern "C" void free(void* memory) noexcept;

// An aligned buffer of zeros, which is freed at the end of the block. As a bool, a buffer is false if there was no
// memory for it; the kernel then returns NO_MEMORY.
template <class T>
struct Buffer : Array<T, 1> {
    void* memory;

    explicit Buffer(int64_t num) : Array<T, 1>{nullptr, {num}}, memory(calloc(num * (int64_t)sizeof(T) + (int64_t)alignof(T), 1)) {
        if (memory) this->data = (T*)(((uintptr_t)memory + alignof(T) - 1) / alignof(T) * alignof(T));
    }
    ~Buffer() { free(memory); }
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;

    explicit operator bool() const { return this->data != nullptr; }
};

template <class T>
INLINE T least(T a, T b) { return b < a ? b : a; }

template <class T>
INLINE T most(T a, T b) { return b > a ? b : a; }

// Return whether the shape of each other array begins with the shape of the first array.
template <class T, int DIMENSIONS, class... Others>
INLINE bool match(const Array<T, DIMENSIONS>& first, const Others&... others) {
    bool are_equal = true;
    for (int axis = 0; axis < DIMENSIONS; axis++) are_equal &= ((others.shape[axis] == first.shape[axis]) && ...);
    return are_equal;
}

INLINE bool is_nan(double x) { return x != x; }

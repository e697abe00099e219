// Count the bit patterns of voxels (renderer/statistics/value_counts.py).
#include "volume/kernels.h"

// Count the patterns of voxels. Neighbours are often equal, and a counter would wait for itself: voxel k counts in table
// k modulo NUM_TABLES.
Status count_patterns(const CountPatterns* arguments) {
    constexpr int64_t NUM_TABLES = 4;
    const auto& [raw, counts] = *arguments;
    const int64_t num = counts.shape[0];
    if ((raw.dtype != 0 || num != 1 << 8) && (raw.dtype != 2 || num != 1 << 16)) return OUT_OF_BOUNDS;
    Buffer<uint32_t> tables(NUM_TABLES * num);
    if (!tables) return NO_MEMORY;
    auto count = [&]<class T>(const T* patterns, int64_t size) {
        int64_t k = 0;
        for (; k + NUM_TABLES <= size; k += NUM_TABLES)
            for (int64_t table = 0; table < NUM_TABLES; table++) tables[table * num + patterns[k + table]]++;
        for (; k < size; k++) tables[patterns[k]]++;
    };
    int64_t size = raw.shape[0] * raw.shape[1] * raw.shape[2];
    if (raw.dtype == 0) count((const uint8_t*)raw.data, size);
    else count((const uint16_t*)raw.data, size);
    for (int64_t table = 0; table < NUM_TABLES; table++)
        for (int64_t pattern = 0; pattern < num; pattern++) counts[pattern] += tables[table * num + pattern];
    return DONE;
}

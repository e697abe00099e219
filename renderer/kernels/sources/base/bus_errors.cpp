// Handle SIGBUS, which a read beyond the end of a mapped file raises, even in the middle of a kernel.
//
// If the file of a guarded region has become shorter, the handler maps zeros in place of the lost pages, and the kernel
// goes on. Other causes of SIGBUS, such as a broken disk, go to the former handler, which ends the process. A handler
// in Python would run between two bytecodes, and a kernel has none.
#include "base/kernels.h"

#ifdef __linux__
#include <signal.h>
#include <sys/mman.h>
#include <unistd.h>

namespace {

GuardRegions guarded;
struct sigaction former;

// The end of a region, which Python sets last.
int64_t end_of(int64_t region) { return __atomic_load_n(&guarded.regions(region, 1), __ATOMIC_ACQUIRE); }

void handle(int number, siginfo_t* information, void*) {
    const auto& [regions, page_size] = guarded;
    const int64_t fault = (int64_t)information->si_addr;
    const bool was_sent = information->si_code <= 0;  // another process sent it: it has no address
    for (int64_t k = 0; k < regions.shape[0] && !was_sent; k++) {
        const int64_t end = end_of(k);
        if (fault < regions(k, 0) || fault >= end) continue;
        const int64_t length = lseek((int)regions(k, 2), 0, SEEK_END);
        if (length < 0 || length >= regions(k, 3)) continue;
        // Zeros are mapped up to the end of the region, where the file is gone, too: single pages could exceed the
        // number of maps.
        void* first = (void*)(fault & -page_size);
        const int kind = MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE;
        if (mmap(first, end - (int64_t)first, PROT_READ, kind, -1, 0) == first) return;
    }
    sigaction(number, &former, nullptr);  // the same instruction faults again
    if (was_sent) raise(number);          // the signal comes when the handler returns
}

}  // namespace
#endif

// Install the handler of SIGBUS.
Status guard_regions(const GuardRegions* arguments) {
#ifdef __linux__
    guarded = *arguments;
    struct sigaction action = {};
    action.sa_sigaction = handle;
    action.sa_flags = SA_SIGINFO;
    // The former handler is read first, because a fault may come at once.
    if (sigaction(SIGBUS, nullptr, &former) == 0) sigaction(SIGBUS, &action, nullptr);
#endif
    return DONE;
}

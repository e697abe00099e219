// Handle SIGBUS, which a read beyond the end of a mapped file raises, even in the middle of a kernel.
//
// If the file of a guarded region has become shorter, the handler maps zeros in place of the lost pages, and the kernel
// goes on. Other causes of SIGBUS, such as a broken disk, go to the former handler, which ends the process. The handler
// is in C++, because Python never runs a handler inside a kernel.
#include "base/kernels.h"

#ifdef __linux__
#include <signal.h>
#include <sys/mman.h>
#include <unistd.h>

namespace {

// The guarded regions, which Python fills in.
GuardRegions guarded;
// The handler of SIGBUS that this handler replaces.
struct sigaction former;

// Return the end of a region: the address after its last byte. Python sets this number of a region after all others.
int64_t end_of(int64_t region) { return __atomic_load_n(&guarded.regions(region, 1), __ATOMIC_ACQUIRE); }

void handle(int number, siginfo_t* information, void*) {
    const auto& [regions, page_size] = guarded;
    const int64_t fault = (int64_t)information->si_addr;
    const bool was_sent = information->si_code <= 0;  // a signal that a process sent has no address of a fault
    for (int64_t k = 0; k < regions.shape[0] && !was_sent; k++) {
        const int64_t end = end_of(k);
        if (fault < regions(k, 0) || fault >= end) continue;
        const int64_t length = lseek((int)regions(k, 2), 0, SEEK_END);
        if (length < 0 || length >= regions(k, 3)) continue;
        // Zeros are mapped from the fault to the end of the region, because the file is gone there, too. Mapping page
        // by page could exceed the largest number of maps that the system allows.
        void* first = (void*)(fault & -page_size);
        const int kind = MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE;
        if (mmap(first, end - (int64_t)first, PROT_READ, kind, -1, 0) == first) return;
    }
    sigaction(number, &former, nullptr);  // the same instruction faults again, now to the former handler
    if (was_sent) raise(number);          // send the signal again: it is handled when this handler returns
}

}  // namespace
#endif

// Install the handler of SIGBUS.
Status guard_regions([[maybe_unused]] const GuardRegions* arguments) {
#ifdef __linux__
    guarded = *arguments;
    struct sigaction action = {};
    action.sa_sigaction = handle;
    action.sa_flags = SA_SIGINFO;
    // The former handler is stored before the new one is installed, because a fault may come at once.
    if (sigaction(SIGBUS, nullptr, &former) == 0) sigaction(SIGBUS, &action, nullptr);
#endif
    return DONE;
}

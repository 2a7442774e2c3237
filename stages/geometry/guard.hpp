// The one exception guard of all shims: nothing thrown crosses into C.
#pragma once

#include <exception>
#include <new>

extern "C" {
#include "pipeline/status.h"
}

namespace npg
{

// Runs body() -> npg_status; std::bad_alloc becomes NPG_MEMORY, anything else NPG_FAILED with the library's
// words.
template <class Body> npg_status guard(const char *where, Body body) noexcept
{
    try {
        return body();
    } catch (const std::bad_alloc &) {
        return npg_error(NPG_MEMORY, "%s: no memory", where);
    } catch (const std::exception &e) {
        return npg_error(NPG_FAILED, "%s: %s", where, e.what());
    } catch (...) {
        return npg_error(NPG_FAILED, "%s: unknown exception", where);
    }
}

} // namespace npg

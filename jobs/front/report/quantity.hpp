// Numbers as people read them.
#pragma once

#include <cstdint>
#include <string>

namespace carillon::report {

std::string format_count(std::int64_t count);  // "37,599"
std::string format_bytes(double bytes);        // "1.32 GB", of 1e9 bytes
std::string format_seconds(double seconds);    // "5.51 s", "12 min 3 s", "3 h 20 min"
std::string format_hz(double freq_hz);         // "834.07 Hz"
std::string format_cents(double cents);        // "330 cent", "0.012 cent", "unknown"
std::string format_percent(double share);      // "23 %", "0.4 %"
std::string format_plain(double value);        // six digits, "1.5e-09"
std::string format_large(double value);        // "29.7 G": thousands, millions ... as k, M, G, T, P

}  // namespace carillon::report

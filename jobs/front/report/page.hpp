// The page of a report: HTML with {{STYLE}}, {{DATA}} and {{SCRIPT}}, CSS, and the script that shows the data.
#pragma once

namespace carillon::report {

extern const char* const kPage;
extern const char* const kStyle;
extern const char* const kScript;

}  // namespace carillon::report

// SPDX-License-Identifier: GPL-3.0-or-later
// xxHash with every function inline: nothing to link, and no symbol of it leaves the library.
#pragma once

#define XXH_INLINE_ALL
#include <xxhash.h>

/* What all functions that XLA calls have in common. */
#include <stdint.h>

#include "xla/ffi/api/c_api.h"

static double *numbers(void *buffer)
{
    return (double *)((XLA_FFI_Buffer *)buffer)->data;
}

static int64_t size(void *buffer, int64_t axis)
{
    return ((XLA_FFI_Buffer *)buffer)->dims[axis];
}

/* Whether XLA asks only for which version of its interface a function was compiled; it then has the answer. */
static int asks_version(XLA_FFI_CallFrame *frame)
{
    XLA_FFI_Metadata_Extension *asked = (XLA_FFI_Metadata_Extension *)frame->extension_start;
    if (!asked || asked->extension_base.type != XLA_FFI_Extension_Metadata)
        return 0;
    asked->metadata->api_version.major_version = XLA_FFI_API_MAJOR;
    asked->metadata->api_version.minor_version = XLA_FFI_API_MINOR;
    return 1;
}

/* Launches a kernel on the stream of XLA through the driver of CUDA, which is loaded when it is first needed. */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>

#include "call.h"

#define THREADS 128 /* of a block */
#define DEVICES 64

#define ELSEWHERE \
    "This loop was printed for the GPU, and runs on a processor. Trace it where it is to run: `with " \
    "jax.default_device(jax.devices(\"cpu\")[0]):`."

/* Of each architecture of the GPUs of this process. */
@images@
static const void *const images[] = {@names@};

typedef int (*Load)(void **, const void *);
typedef int (*Find)(void **, void *, const char *);
typedef int (*Launch)(void *, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned, unsigned, void *, void **,
                      void **);
typedef int (*ContextOf)(void *, void **);
typedef int (*Push)(void *);
typedef int (*Pop)(void **);

static XLA_FFI_Error *says(XLA_FFI_CallFrame *frame, const char *text)
{
    XLA_FFI_Error_Create_Args error = {XLA_FFI_Error_Create_Args_STRUCT_SIZE, 0, text, XLA_FFI_Error_Code_INTERNAL};
    return frame->api->XLA_FFI_Error_Create(&error);
}

static XLA_FFI_Error *failed(XLA_FFI_CallFrame *frame, const char *what, int code)
{
    char text[200];
    snprintf(text, sizeof text, "The printed kernel did not run: %s of the CUDA driver failed with code %d.", what, code);
    return says(frame, text);
}

/* What a processor answers. */
XLA_FFI_Error *elsewhere(XLA_FFI_CallFrame *frame)
{
    return asks_version(frame) ? 0 : says(frame, ELSEWHERE);
}

/* The kernel in a context, loaded once for each; two threads that come at once may load it twice, which does no harm. */
static int function_in(void *context, void *driver, void **function)
{
    static struct {
        void *context, *function;
    } known[DEVICES];
    void *module;
    for (int i = 0; i < DEVICES && known[i].context; i++)
        if (known[i].context == context) {
            *function = known[i].function;
            return 0;
        }
    int code = 1;
    for (size_t i = 0; code && i < sizeof images / sizeof *images; i++) /* the driver refuses other architectures */
        code = ((Load)dlsym(driver, "cuModuleLoadData"))(&module, images[i]);
    if (!code)
        code = ((Find)dlsym(driver, "cuModuleGetFunction"))(function, module, "steps_of_points");
    for (int i = 0; !code && i < DEVICES; i++)
        if (!known[i].context) {
            known[i].function = *function;
            known[i].context = context;
            break;
        }
    return code;
}

XLA_FFI_Error *loop(XLA_FFI_CallFrame *frame)
{
    if (asks_version(frame))
        return 0;
    void *driver = dlopen("libcuda.so.1", RTLD_NOW), *context, *function, *before;
    if (!driver)
        return failed(frame, "the loading of libcuda.so.1", 0);
    XLA_FFI_Stream_Get_Args stream = {XLA_FFI_Stream_Get_Args_STRUCT_SIZE, 0, frame->ctx, 0};
    XLA_FFI_Error *error = frame->api->XLA_FFI_Stream_Get(&stream);
    if (error)
        return error;
    void **in = frame->args.args, **out = frame->rets.rets;
    int64_t steps = size(in[4], 0), points = size(in[3], 1);
    void *a[7];
    for (int i = 0; i < 7; i++)
        a[i] = numbers(i < 5 ? in[i] : out[i - 5]);
    void *arguments[] = {&a[0], &a[1], &a[2], &a[3], &a[4], &steps, &points, &a[5], &a[6]};
    int code = ((ContextOf)dlsym(driver, "cuStreamGetCtx"))(stream.stream, &context);
    if (code)
        return failed(frame, "cuStreamGetCtx", code);
    code = ((Push)dlsym(driver, "cuCtxPushCurrent_v2"))(context);
    if (code)
        return failed(frame, "cuCtxPushCurrent", code);
    code = function_in(context, driver, &function);
    const char *what = "the loading of the kernel";
    if (!code) {
        what = "cuLaunchKernel";
        code = ((Launch)dlsym(driver, "cuLaunchKernel"))(function, (unsigned)((points + THREADS - 1) / THREADS), 1, 1,
                                                         THREADS, 1, 1, 0, stream.stream, arguments, 0);
    }
    ((Pop)dlsym(driver, "cuCtxPopCurrent_v2"))(&before);
    return code ? failed(frame, what, code) : 0;
}

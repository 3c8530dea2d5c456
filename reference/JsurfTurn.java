import de.mfo.jsurf.rendering.Camera;
import de.mfo.jsurf.rendering.LightSource;
import de.mfo.jsurf.rendering.cpu.AntiAliasingPattern;
import de.mfo.jsurf.rendering.cpu.CPUAlgebraicSurfaceRenderer;
import java.awt.image.BufferedImage;
import java.io.BufferedReader;
import java.io.File;
import java.io.InputStreamReader;
import javax.imageio.ImageIO;
import javax.vecmath.Color3f;
import javax.vecmath.Matrix4d;
import javax.vecmath.Point3d;
import javax.vecmath.Vector3d;

/**
 * Draws a surface with jsurf, turned by angles that are read from standard input, one a line. Writes the seconds of
 * each picture to standard output. After the last angle, the last picture is written to a PNG file.
 *
 * Arguments: formula f of f(x, y, z) = 0, radius of the ball it is cut with, pixels of a side, PNG file.
 */
public class JsurfTurn {
    public static void main(String[] arguments) throws Exception {
        int side = Integer.parseInt(arguments[2]);
        CPUAlgebraicSurfaceRenderer renderer = new CPUAlgebraicSurfaceRenderer();
        renderer.setSurfaceFamily(arguments[0]);
        // One ray for each pixel, as SURFER draws while a surface is turned.
        renderer.setAntiAliasingMode(CPUAlgebraicSurfaceRenderer.AntiAliasingMode.ADAPTIVE_SUPERSAMPLING);
        renderer.setAntiAliasingPattern(AntiAliasingPattern.OG_1x1);
        // jsurf cuts surfaces with the unit ball: a point p of it shows f(radius p).
        Matrix4d scale = new Matrix4d();
        scale.setIdentity();
        scale.setScale(Double.parseDouble(arguments[1]));
        renderer.setSurfaceTransform(scale);
        Camera camera = renderer.getCamera();
        camera.setCameraType(Camera.CameraType.ORTHOGRAPHIC_CAMERA);
        camera.setHeight(2.2);
        camera.lookAt(new Point3d(0, 0, 5), new Point3d(0, 0, 0), new Vector3d(0, 1, 0));
        LightSource light = new LightSource();
        light.setPosition(new Point3d(3, 4, 5));
        light.setColor(new Color3f(1, 1, 1));
        light.setIntensity(1);
        light.setStatus(LightSource.Status.ON);
        renderer.setLightSource(0, light);
        int[] pixels = new int[side * side];
        BufferedReader angles = new BufferedReader(new InputStreamReader(System.in));
        for (String line = angles.readLine(); line != null; line = angles.readLine()) {
            Matrix4d turn = new Matrix4d();
            turn.rotY(Double.parseDouble(line));
            long begun = System.nanoTime();
            renderer.setTransform(turn);
            renderer.draw(pixels, side, side);
            System.out.println((System.nanoTime() - begun) * 1e-9);
        }
        BufferedImage picture = new BufferedImage(side, side, BufferedImage.TYPE_INT_RGB);
        for (int row = 0; row < side; row++) {
            picture.setRGB(0, row, side, 1, pixels, (side - 1 - row) * side, side);
        }
        ImageIO.write(picture, "png", new File(arguments[3]));
        System.exit(0);
    }
}
